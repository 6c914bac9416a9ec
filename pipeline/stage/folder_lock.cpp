// An advisory lock on a hidden file, whose text names the owner.
#include "pipeline/stage/folder_lock.h"

#include <fmt/format.h>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <thread>

#include "io/base/error.h"
#include "io/base/owned_folder.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;

std::string ThisProcess() {
  char host[128] = "", when[32] = "";
  gethostname(host, sizeof host - 1);
  const std::time_t now = std::time(nullptr);
  std::strftime(when, sizeof when, "%F %T", std::localtime(&now));
  return fmt::format("process {} on {} since {}", getpid(), host, when);
}

// A killed owner with much memory takes a moment to go, and its stages go after it.
constexpr std::chrono::milliseconds kOwnerGoes(3000), kLook(20);

bool TryLock(int fd) {
  const auto start = std::chrono::steady_clock::now();
  while (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK || std::chrono::steady_clock::now() - start > kOwnerGoes) return false;
    std::this_thread::sleep_for(kLook);
  }
  return true;
}

// Returns what went wrong, or nothing. Throws kLocked when another process holds the lock.
std::string Acquire(int fd, const std::filesystem::path& run_folder) {
  if (TryLock(fd)) {
    const std::string owner = ThisProcess();
    const bool written = ftruncate(fd, 0) == 0 && pwrite(fd, owner.data(), owner.size(), 0) >= 0;
    return written ? "" : std::strerror(errno);
  }
  if (errno != EWOULDBLOCK) return std::strerror(errno);
  char owner[256] = "";
  const ssize_t n = pread(fd, owner, sizeof owner - 1, 0);
  throw Error(ExitCode::kLocked,
              run_folder.string() + ": in use by " + (n > 0 ? owner : "another process"),
              "Wait for it, or choose another --out");
}

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& run_folder, const std::string& name) {
  io::ClaimFolder(run_folder);
  const std::filesystem::path path = run_folder / ("." + name + ".lock");
  fd_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  std::string fault = fd_ < 0 ? std::strerror(errno) : "";
  try {
    if (fd_ >= 0) fault = Acquire(fd_, run_folder);
    if (!fault.empty())
      throw Error(ExitCode::kNoResources,
                  path.string() + ": cannot be locked (" + fault + ")",
                  "Choose another --out");
  } catch (...) {
    if (fd_ >= 0) close(fd_);
    throw;
  }
}

FolderLock::~FolderLock() {
  if (fd_ >= 0) close(fd_);
}

}  // namespace pipeline
