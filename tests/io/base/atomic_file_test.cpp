// io/base/atomic_file.h and io/base/hash.h: a name is the old content or the new one, also when the disk is
// full or the writer is killed.
#include "io/base/atomic_file.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <thread>

#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/base/owned_folder.h"
#include "io/process/interrupt.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;

// Limits the size of any file written by this process, as a full disk would.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit = {bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() { setrlimit(RLIMIT_FSIZE, &before_); }

 private:
  rlimit before_ = {};
};

TEST(AtomicFile, WritesAndReplacesWithParents) {
  const TempDir dir;
  const fs::path file = dir / "a/b/c.txt";
  io::WriteFileAtomically(file, "one");
  EXPECT_EQ(io::ReadFile(file), "one");
  const std::string bytes("two\0three", 9);
  io::WriteFileAtomically(file, bytes);
  EXPECT_EQ(io::ReadFile(file), bytes);
  io::WriteFileAtomically(file, "");
  EXPECT_EQ(io::ReadFile(file), "");
  EXPECT_EQ(CountEntries(dir.path()), 3);  // a, a/b, c.txt: no temporary is left
}

TEST(AtomicFile, FullDiskKeepsTheOldFileAndSaysHowMuchIsNeeded) {
  io::InstallInterruptHandlers();
  const TempDir dir;
  io::WriteFileAtomically(dir / "f", "old");
  const std::string big(100000, 'x');
  for (const rlim_t bytes : {0u, 1u, 4096u, 99999u}) {
    const FileSizeLimit limit(bytes);
    EXPECT_ERROR(io::WriteFileAtomically(dir / "f", big), io::ExitCode::kNoResources, "100000 bytes");
    EXPECT_EQ(ReadText(dir / "f"), "old");
    EXPECT_EQ(CountEntries(dir.path()), 1);
  }
  const FileSizeLimit limit(100000);
  io::WriteFileAtomically(dir / "f", big);
  EXPECT_EQ(ReadText(dir / "f"), big);
}

TEST(AtomicFile, UnwritablePlacesAreNamed) {
  const TempDir dir;
  io::WriteFileAtomically(dir / "file", "x");
  EXPECT_ERROR(io::WriteFileAtomically(dir / "file/below", "y"), io::ExitCode::kNoResources, "file/below");
  fs::create_directory(dir / "folder");
  EXPECT_ERROR(io::WriteFileAtomically(dir / "folder", "y"), io::ExitCode::kNoResources, "folder");
  EXPECT_EQ(CountEntries(dir.path()), 2);
}

TEST(AtomicFile, KilledWriterLeavesOldOrNewAndTheRestCanBeSwept) {
  const TempDir dir;
  const std::string a(3000000, 'a'), b(3000000, 'b');
  io::WriteFileAtomically(dir / "f", a);
  for (int kill_after_us = 0; kill_after_us < 8000; kill_after_us += 500) {
    const pid_t writer = fork();
    if (writer == 0) {
      for (;;) {
        io::WriteFileAtomically(dir / "f", b);
        io::WriteFileAtomically(dir / "f", a);
      }
    }
    usleep(static_cast<useconds_t>(kill_after_us));
    kill(writer, SIGKILL);
    waitpid(writer, nullptr, 0);
    const std::string content = ReadText(dir / "f");
    ASSERT_TRUE(content == a || content == b) << content.size();
  }
  io::RemoveTemporaries(dir.path());
  EXPECT_EQ(CountEntries(dir.path()), 1);
}

TEST(AtomicFile, ReplacesFoldersAsAWhole) {
  const TempDir dir;
  io::ClaimFolder(dir / "target");
  WriteText(dir / "target/old.txt", "old");
  io::ClaimFolder(dir / "partial");
  WriteText(dir / "partial/sub/new.txt", "new");
  io::ReplaceFolder(dir / "partial", dir / "target");
  EXPECT_EQ(ReadText(dir / "target/sub/new.txt"), "new");
  EXPECT_EQ(CountEntries(dir.path()), 4);  // target, its marker, sub, new.txt
  WriteText(dir / "partial/x", "first");
  io::ReplaceFolder(dir / "partial", dir / "fresh");
  EXPECT_EQ(ReadText(dir / "fresh/x"), "first");
  EXPECT_FALSE(fs::exists(dir / "partial"));
  WriteText(dir / "users/file.txt", "the user's");
  EXPECT_ERROR(io::ReplaceFolder(dir / "target", dir / "users"), io::ExitCode::kBadInput, "users");
  EXPECT_EQ(ReadText(dir / "users/file.txt"), "the user's");
}

TEST(AtomicFile, ReadFileRefusesWhatItShould) {
  const TempDir dir;
  WriteText(dir / "f", "12345");
  EXPECT_EQ(io::ReadFile(dir / "f", 5), "12345");
  EXPECT_ERROR(io::ReadFile(dir / "f", 4), io::ExitCode::kBadInput, "4 bytes");
  EXPECT_ERROR(io::ReadFile(dir / "none"), io::ExitCode::kBadInput, "none", "no such file");
  EXPECT_ERROR(io::ReadFile(dir.path()), io::ExitCode::kBadInput, dir.path().string(), "no such file");
}

// One writer puts a long file and a short one under the name in turn, as fast as it can.
TEST(AtomicFile, AReaderGetsOneFileWholeWhileOthersTakeItsName) {
  const TempDir dir;
  const std::string contents[2] = {std::string(3000, 'l'), std::string(10, 's')};
  for (int i = 0; i < 2; ++i) io::WriteFileAtomically(dir / std::to_string(i), contents[i]);
  fs::create_hard_link(dir / "0", dir / "file");
  std::atomic<bool> stop = false;
  std::thread writer([&] {
    for (int i = 1; !stop; i = 1 - i) {
      fs::create_hard_link(dir / std::to_string(i), dir / "next");
      fs::rename(dir / "next", dir / "file");
    }
  });
  int n_whole = 0;
  constexpr int kReads = 5000;
  try {
    for (int i = 0; i < kReads; ++i) {
      const std::string read = io::ReadFile(dir / "file");
      n_whole += read == contents[0] || read == contents[1];
    }
  } catch (const io::Error& error) {
    ADD_FAILURE() << error.what();
  }
  stop = true;
  writer.join();
  EXPECT_EQ(n_whole, kReads);
}

TEST(Hash, StreamedAndWholeAgreeAndSeeEveryByte) {
  const TempDir dir;
  std::string bytes(3 << 20, 'z');  // several blocks of the stream
  io::WriteFileAtomically(dir / "f", bytes);
  const std::string hash = io::HashFile(dir / "f");
  EXPECT_EQ(hash.size(), 32u);
  EXPECT_EQ(hash, io::HashBytes(bytes));
  for (const std::size_t at : {std::size_t{0}, bytes.size() / 2, bytes.size() - 1}) {
    bytes[at] ^= 1;
    EXPECT_NE(io::HashBytes(bytes), hash);
    bytes[at] ^= 1;
  }
  EXPECT_EQ(io::HashBytes(""), "99aa06d3014798d86001c324468d497f");  // XXH3-128 of nothing
  EXPECT_ERROR(io::HashFile(dir / "none"), io::ExitCode::kBadInput, "none");
  std::filesystem::create_directory(dir / "folder");
  EXPECT_ERROR(io::HashFile(dir / "folder"), io::ExitCode::kBadInput, "folder: cannot be read");
}

}  // namespace
