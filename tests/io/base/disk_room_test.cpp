// Lack of room is told by its figure.
#include "io/base/disk_room.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace {

// Exit code of what ThrowIfFull says under a limit on the size of files, in a process of its own.
int UnderLimit(const std::filesystem::path& folder, rlim_t bytes) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit limit = {bytes, bytes};
    setrlimit(RLIMIT_FSIZE, &limit);
    try {
      io::ThrowIfFull(folder);
      _exit(0);
    } catch (const io::Error& error) {
      const std::string what = error.what();
      _exit(what.find(std::to_string(bytes / 1000) + " kB") != std::string::npos
                ? static_cast<int>(error.code())
                : 1);
    }
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WEXITSTATUS(status);
}

TEST(DiskRoom, FilesAtTheLimitOfTheirSizeAreNamed) {
  const TempDir dir;
  WriteText(dir / "below/database.db", std::string(3'000'000, 'x'));
  EXPECT_EQ(UnderLimit(dir.path(), 3'100'000), static_cast<int>(io::ExitCode::kNoResources));
  EXPECT_EQ(UnderLimit(dir.path(), 9'000'000), 0);
  EXPECT_NO_THROW(io::ThrowIfFull(dir.path()));
  EXPECT_NO_THROW(io::ThrowIfFull(dir / "absent"));
}

}  // namespace
