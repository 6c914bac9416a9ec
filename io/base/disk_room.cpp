#include "io/base/disk_room.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/statvfs.h>

#include "io/base/error.h"

namespace io {
namespace {

namespace fs = std::filesystem;

// What writers leave unused when the next piece does not fit: SQLite and encoders write up to a megabyte at
// once.
constexpr std::uintmax_t kPiece = std::uintmax_t{1} << 20;

std::uintmax_t LargestFile(const fs::path& folder) {
  std::uintmax_t largest = 0;
  std::error_code ignored;
  for (fs::recursive_directory_iterator at(folder, ignored), end; !ignored && at != end;
       at.increment(ignored)) {
    std::error_code gone;
    const std::uintmax_t size = at->is_regular_file(gone) ? at->file_size(gone) : 0;
    if (!gone) largest = std::max(largest, size);
  }
  return largest;
}

}  // namespace

void ThrowIfFull(const fs::path& folder) {
  struct statvfs disk;
  if (statvfs(folder.c_str(), &disk) == 0 && disk.f_blocks > 0) {
    const std::uintmax_t left = std::uintmax_t{disk.f_bavail} * disk.f_frsize;
    if (left < kPiece)
      throw Error(ExitCode::kNoResources,
                  fmt::format("{}: the disk is full, {} kB are left", folder.string(), left / 1000),
                  "Free some room, or choose another --out");
  }
  rlimit limit;
  if (getrlimit(RLIMIT_FSIZE, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY &&
      LargestFile(folder) + std::min<std::uintmax_t>(kPiece, limit.rlim_cur / 2) > limit.rlim_cur)
    throw Error(ExitCode::kNoResources,
                fmt::format("{}: files may not grow beyond {} kB", folder.string(), limit.rlim_cur / 1000),
                "Raise the limit with ulimit -f");
}

}  // namespace io
