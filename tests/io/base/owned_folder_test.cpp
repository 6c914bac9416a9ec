// io/base/owned_folder.h: what the program did not write stays.
#include "io/base/owned_folder.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;

TEST(OwnedFolder, NewAndEmptyFoldersBecomeOurs) {
  const TempDir dir;
  io::ClaimFolder(dir / "a/b");
  fs::create_directory(dir / "empty");
  io::ClaimFolder(dir / "empty");
  for (const char* name : {"a/b", "empty"}) {
    WriteText(dir / name / "file", "ours");
    io::ClaimFolder(dir / name);
    io::RequireOwnedFolder(dir / name);
    io::RecreateOwnedFolder(dir / name);
    EXPECT_EQ(CountEntries(dir / name), 1);  // the marker
    io::RemoveOwnedFolder(dir / name);
    EXPECT_FALSE(fs::exists(dir / name));
    io::RemoveOwnedFolder(dir / name);
  }
}

TEST(OwnedFolder, OthersAreRefusedByName) {
  const TempDir dir;
  WriteText(dir / "users/file", "the user's");
  fs::create_directory_symlink(dir / "users", dir / "link");
  io::ClaimFolder(dir / "ours");
  fs::create_directory_symlink(dir / "ours", dir / "link_to_ours");
  for (const char* name : {"users", "link"}) {
    EXPECT_ERROR(io::ClaimFolder(dir / name), io::ExitCode::kBadInput, name);
    EXPECT_ERROR(io::RemoveOwnedFolder(dir / name), io::ExitCode::kBadInput, name);
    EXPECT_ERROR(io::RecreateOwnedFolder(dir / name), io::ExitCode::kBadInput, name);
  }
  io::ClaimFolder(dir / "link_to_ours");  // a run folder may lie elsewhere; nothing is replaced by this
  EXPECT_ERROR(io::RequireOwnedFolder(dir / "link_to_ours"), io::ExitCode::kBadInput, "link_to_ours");
  EXPECT_ERROR(io::RequireOwnedFolder(dir / "users/file"), io::ExitCode::kBadInput, "users/file");
  EXPECT_ERROR(io::ClaimFolder(dir / "users/file"), io::ExitCode::kUsage, "users/file");
  EXPECT_EQ(CountEntries(dir / "users"), 1);
  // A link as the marker is none: it could lead to a file of the user's.
  WriteText(dir / "planted/file", "the user's");
  fs::create_symlink(dir / "users/file", dir / "planted" / io::kFolderMarker);
  EXPECT_ERROR(io::RemoveOwnedFolder(dir / "planted"), io::ExitCode::kBadInput, "planted");
  EXPECT_EQ(ReadText(dir / "users/file"), "the user's");
}

TEST(OwnedFolder, WhatAKilledRemovalLeavesIsStillOurs) {
  const TempDir dir;
  constexpr int kKills = 20;
  for (int i = 0; i < kKills; ++i) {
    io::ClaimFolder(dir / "f");
    for (int k = 0; k < 200; ++k) WriteText(dir / "f" / std::to_string(k), "x");
    const pid_t child = fork();
    if (child == 0) {
      io::RemoveOwnedFolder(dir / "f");
      _exit(0);
    }
    usleep(static_cast<useconds_t>(200 * i));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    io::RemoveOwnedFolder(dir / "f");
    ASSERT_FALSE(fs::exists(dir / "f"));
  }
}

}  // namespace
