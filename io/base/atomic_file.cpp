#include "io/base/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "io/base/error.h"
#include "io/base/memory.h"
#include "io/base/owned_folder.h"

namespace io {
namespace {

constexpr char kTemporaryExtension[] = ".pipeline-tmp";

[[noreturn]] void Fail(const std::filesystem::path& path, const std::string& doing, std::size_t bytes) {
  const int error = errno;
  const bool full = error == ENOSPC || error == EDQUOT || error == EFBIG;
  throw Error(ExitCode::kNoResources,
              fmt::format("{}: cannot {} ({})", path.string(), doing, std::strerror(error)),
              full ? fmt::format("Free at least {} bytes there", bytes) : "Check the folder's permissions");
}

void SyncPath(const std::filesystem::path& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) Fail(path, "open", 0);
  const int result = fsync(fd);
  close(fd);
  if (result != 0) Fail(path, "sync", 0);
}

}  // namespace

void WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes) {
  WriteFileAtomically(path, std::span(&bytes, 1));
}

void WriteFileAtomically(const std::filesystem::path& path, std::span<const std::string_view> parts) {
  std::size_t size = 0;
  for (const std::string_view part : parts) size += part.size();
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  const std::string name = fmt::format(".{}.{}", path.filename().string(), getpid());
  const std::filesystem::path temporary = folder / (name + kTemporaryExtension);
  unlink(temporary.c_str());  // of a killed process with this number, or a name that leads to another file
  const int fd = open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (fd < 0) Fail(path, "create", size);
  bool ok = true;
  for (std::string_view part : parts) {
    while (ok && !part.empty()) {
      const ssize_t n = write(fd, part.data(), part.size());
      if (n < 0 && errno == EINTR) continue;
      ok = n > 0;
      if (ok) part.remove_prefix(static_cast<std::size_t>(n));
    }
  }
  ok = ok && fsync(fd) == 0;
  int error = errno;
  if (close(fd) != 0 && ok) ok = false, error = errno;
  if (ok && rename(temporary.c_str(), path.c_str()) != 0) ok = false, error = errno;
  if (!ok) {
    unlink(temporary.c_str());
    errno = error;
    Fail(path, "write", size);
  }
  SyncPath(folder);
}

void RemoveTemporaries(const std::filesystem::path& folder) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == kTemporaryExtension) std::filesystem::remove(entry.path());
  }
}

void ReplaceFolder(const std::filesystem::path& folder, const std::filesystem::path& target) {
  RequireOwnedFolder(target);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_symlink() && (entry.is_regular_file() || entry.is_directory())) SyncPath(entry.path());
  }
  SyncPath(folder);
  const bool exchanged = renameat2(AT_FDCWD, folder.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0;
  if (!exchanged) {  // nothing to replace, or the file system cannot exchange
    RemoveOwnedFolder(target);
    if (rename(folder.c_str(), target.c_str()) != 0) Fail(target, "create", 0);
  }
  SyncPath(target.parent_path());
  if (exchanged) RemoveOwnedFolder(folder);
}

std::string ReadFile(const std::filesystem::path& path, std::size_t max_bytes) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    throw Error(ExitCode::kBadInput, path.string() + ": no such file");
  }
  errno = 0;
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  // Of the file that is open: another one may take its name meanwhile.
  const std::streamoff size = in.tellg();
  if (size >= 0 && static_cast<std::uintmax_t>(size) > max_bytes) {
    throw Error(ExitCode::kBadInput, fmt::format("{}: larger than {} bytes", path.string(), max_bytes));
  }
  std::string bytes(size < 0 ? 0 : static_cast<std::size_t>(size), '\0');
  if (size < 0 || !in.seekg(0).read(bytes.data(), size)) {
    ThrowIfMemoryWasRefused();
    throw Error(ExitCode::kBadInput, path.string() + ": cannot be read");
  }
  return bytes;
}

}  // namespace io
