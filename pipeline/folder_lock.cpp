#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstring>
#include <ctime>

#include "io/error.h"
#include "pipeline/stage.h"

namespace pipeline {

using io::Error;
using io::ExitCode;

FolderLock::FolderLock(const std::filesystem::path& run_folder, const std::string& name) {
  std::error_code error;
  std::filesystem::create_directories(run_folder, error);
  if (!std::filesystem::is_directory(run_folder)) {
    throw Error(ExitCode::kUsage,
                run_folder.string() + ": is not a folder that can be created",
                "Choose another --out");
  }
  const std::filesystem::path path = run_folder / ("." + name + ".lock");
  fd_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (fd_ < 0)
    throw Error(ExitCode::kNoResources, path.string() + ": " + std::strerror(errno), "Choose another --out");
  if (flock(fd_, LOCK_EX | LOCK_NB) != 0) {
    char owner[256] = "";
    const ssize_t n = pread(fd_, owner, sizeof owner - 1, 0);
    close(fd_);
    throw Error(ExitCode::kLocked,
                run_folder.string() + ": in use by " + (n > 0 ? owner : "another process"),
                "Wait for it, or choose another --out");
  }
  char host[128] = "", when[32] = "";
  gethostname(host, sizeof host - 1);
  const std::time_t now = std::time(nullptr);
  std::strftime(when, sizeof when, "%F %T", std::localtime(&now));
  const std::string owner = "process " + std::to_string(getpid()) + " on " + host + " since " + when;
  if (ftruncate(fd_, 0) != 0 || pwrite(fd_, owner.data(), owner.size(), 0) < 0) {
    throw Error(ExitCode::kNoResources, path.string() + ": cannot be written");
  }
}

FolderLock::~FolderLock() {
  if (fd_ >= 0) close(fd_);
}

}  // namespace pipeline
