#include "io/base/owned_folder.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <string_view>

#include "io/base/error.h"

namespace io {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMarkerText = "This folder is written, replaced and removed by `pipeline`.\n";

bool IsMarked(const fs::path& folder) {
  std::error_code ignored;
  return fs::is_regular_file(fs::symlink_status(folder / kFolderMarker, ignored));
}

[[noreturn]] void Refuse(const fs::path& folder) {
  throw Error(ExitCode::kBadInput,
              folder.string() + ": holds files that this program did not write",
              "Choose another --out, or move them away");
}

bool SyncFolder(const fs::path& folder) {
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool synced = fd >= 0 && fsync(fd) == 0;
  if (fd >= 0) close(fd);
  return synced;
}

// The marker is the first file of a folder, and durable before the next: whoever sees other files sees it
// too.
void Mark(const fs::path& folder) {
  const fs::path marker = folder / kFolderMarker;
  const int fd = open(marker.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644);
  const bool written =
      fd >= 0 &&
      write(fd, kMarkerText.data(), kMarkerText.size()) == static_cast<ssize_t>(kMarkerText.size()) &&
      fsync(fd) == 0 && SyncFolder(folder);
  const int error = errno;
  if (fd >= 0) close(fd);
  if (!written) {
    throw Error(ExitCode::kNoResources,
                marker.string() + ": cannot be written (" + std::strerror(error) + ")",
                "Choose another --out");
  }
}

}  // namespace

void ClaimFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder, error)) {
    throw Error(ExitCode::kUsage,
                folder.string() + ": is not a folder and none can be created",
                "Choose another --out");
  }
  const bool is_empty = fs::is_empty(folder, error) && !error;
  if (!is_empty && !IsMarked(folder)) Refuse(folder);
  // A marker without its text is that of a folder whose making was cut off.
  if (is_empty || fs::file_size(folder / kFolderMarker, error) != kMarkerText.size()) Mark(folder);
}

void RequireOwnedFolder(const fs::path& folder) {
  std::error_code error;
  const fs::file_status status = fs::symlink_status(folder, error);
  if (status.type() == fs::file_type::not_found) return;
  const bool is_ours =
      fs::is_directory(status) && (fs::is_empty(folder, error) || IsMarked(folder)) && !error;
  if (!is_ours) Refuse(folder);
}

void RemoveOwnedFolder(const fs::path& folder) {
  RequireOwnedFolder(folder);
  if (!fs::exists(folder)) return;
  // The marker goes last: what a killed process leaves is still ours.
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().filename() != kFolderMarker) fs::remove_all(entry.path());
  }
  fs::remove_all(folder);
}

void RecreateOwnedFolder(const fs::path& folder) {
  RemoveOwnedFolder(folder);
  ClaimFolder(folder);
}

}  // namespace io
