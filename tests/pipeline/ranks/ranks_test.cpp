// Stages on several ranks, as processes of this machine: what they write is what one rank writes, and what
// goes wrong with one is said by all others.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <map>
#include <optional>
#include <thread>

#include "io/base/error.h"
#include "io/process/process.h"
#include "nerf/fields/checkpoint.h"
#include "nerf/kernels/kernels.h"
#include "tests/support/files/small_capture.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/require_program.h"
#include "tests/support/scenes/learnable_views.h"

namespace {

namespace fs = std::filesystem;
using io::ExitCode;
using testing::HasSubstr;

fs::path Program(const std::string& stage) { return fs::path(BINARY_DIR) / "bin" / ("pipeline-" + stage); }

class Ranks : public SmallCapture {
 protected:
  Ranks() {
    tests::WriteLearnableViews(dir_ / "pictures");
    EXPECT_EQ(io::RunProcess({Program("normalize"),
                              "--out=" + (dir_ / "run").string(),
                              "--poses=" + (dir_ / "pictures/transforms.json").string(),
                              "--image-size=0"},
                             {})
                  .exit_code,
              0);
    sockaddr_in address{.sin_family = AF_INET, .sin_port = 0, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t length = sizeof address;
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    EXPECT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&address), length), 0);
    getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
    port_ = ntohs(address.sin_port);
    close(fd);
  }

  // A copy of the run folder, whose stages have the same keys.
  fs::path Copy(const std::string& name) const {
    fs::copy(dir_ / "run", dir_ / name, fs::copy_options::recursive);
    return dir_ / name;
  }

  // Starts the stage on one rank.
  pid_t Start(
      int rank, int size, const fs::path& run, const std::string& stage, std::vector<std::string> options) {
    std::vector<std::string> words = {"/usr/bin/env",
                                      "RANK=" + std::to_string(rank),
                                      "WORLD_SIZE=" + std::to_string(size),
                                      "MASTER_ADDR=127.0.0.1",
                                      "MASTER_PORT=" + std::to_string(port_),
                                      "PIPELINE_SIMD=" + kernels_[rank],
                                      Program(stage).string(),
                                      "--threads=1"};
    if (!run.empty()) words.push_back("--out=" + run.string());
    words.insert(words.end(), options.begin(), options.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const std::string log = Log(rank);
    const pid_t pid = fork();
    if (pid == 0) {
      const int fd = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
      dup2(fd, STDERR_FILENO), dup2(fd, STDOUT_FILENO);
      execv(argv[0], argv.data());
      _exit(127);
    }
    return pid;
  }
  static int ExitOf(pid_t pid) {
    int status = 0;
    waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  void Run(int size, const fs::path& run, const std::string& stage, const std::vector<std::string>& options) {
    std::vector<pid_t> pids;
    for (int r = 0; r < size; ++r) pids.push_back(Start(r, size, run, stage, options));
    for (int r = 0; r < size; ++r) EXPECT_EQ(ExitOf(pids[static_cast<std::size_t>(r)]), 0) << Said(r);
  }
  std::string Log(int rank) const { return (dir_ / ("rank" + std::to_string(rank))).string(); }
  std::string Said(int rank) const { return ReadText(Log(rank)); }

  // The checkpoint without the times that it took.
  std::string Trained(const fs::path& run) const {
    nerf::TrainState state;
    const auto field = nerf::ReadCheckpoint(run / "train/checkpoint.bin", &state);
    state.elapsed_s = state.field_s = state.splats.begin_s = 0;
    nerf::WriteCheckpoint(dir_ / "checkpoint.bin", field.get(), state);
    return ReadText(dir_ / "checkpoint.bin");
  }
  // Contents of the pictures, films and scores below a folder, by name.
  static std::map<std::string, std::string> Products(const fs::path& folder) {
    std::map<std::string, std::string> products;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      const std::string name = entry.path().lexically_relative(folder);
      if (entry.is_regular_file() && name != folder.filename().string() + ".json")
        products[name] = ReadText(entry.path());
    }
    return products;
  }

  TempDir dir_;
  int port_ = 0;
  std::map<int, std::string> kernels_;  // that a rank is told to use; else its best
};

TEST_F(Ranks, SeveralWriteTheBytesOfOneWithTheKernelsThatAllHave) {
  const fs::path one = Copy("one"), three = Copy("three");
  kernels_[0] = "avx2";
  Run(1, one, "train", {"--steps=70"});  // a rebuild of the occupancy grid among them
  kernels_ = {{1, "avx2"}};
  Run(3, three, "train", {"--steps=70"});
  ASSERT_TRUE(Trained(three) == Trained(one));  // megabytes: not to be printed
  EXPECT_THAT(Said(0), HasSubstr("pipeline: 3 ranks with "));
  if (nerf::kernels::FindKernels("avx512")) {
    EXPECT_THAT(Said(0), HasSubstr("avx2 kernels, the best that all of them have"));
  }
  EXPECT_EQ(Said(1), "");

  fs::copy(
      one / "train", three / "train", fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  for (const auto& [stage, options] : std::map<std::string, std::vector<std::string>>{
           {"evaluate", {}}, {"render", {"--frames=5", "--size=32"}}}) {
    kernels_ = {{0, "avx2"}};
    Run(1, one, stage, options);
    kernels_ = {{2, "avx2"}};
    Run(3, three, stage, options);
    const auto products = Products(one / stage);
    EXPECT_GT(products.size(), 5u);
    EXPECT_TRUE(Products(three / stage) == products) << stage;
  }
}

TEST_F(Ranks, SeveralFindThePosesOfOne) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(7);
  const fs::path one = dir_ / "poses1", two = dir_ / "poses2";
  const std::string images = (folder_ / "images").string();
  ASSERT_EQ(io::RunProcess({Program("ingest"), images, "--out=" + one.string()}, {}).exit_code, 0);
  fs::copy(one, two, fs::copy_options::recursive);
  Run(1, one, "sfm", {"--features=600"});
  Run(2, two, "sfm", {"--features=600"});
  EXPECT_EQ(Said(1), "");
  auto expected = Products(one / "sfm"), products = Products(two / "sfm");
  for (auto* of : {&expected, &products}) of->erase("colmap.log");  // with times, and of one rank
  EXPECT_GT(products.size(), 10u);
  EXPECT_TRUE(products == expected);
}

TEST_F(Ranks, WhatCannotBeReconstructedIsSaidByTheFirstAlone) {
  REQUIRE_PROGRAM("colmap");
  for (const char* name : {"a.png", "b.png", "c.png", "d.png"}) AddStranger(name);
  const fs::path run = dir_ / "strangers";
  const std::string images = (folder_ / "images").string();
  ASSERT_EQ(io::RunProcess({Program("ingest"), images, "--out=" + run.string()}, {}).exit_code, 0);
  const pid_t first = Start(0, 2, run, "sfm", {}), second = Start(1, 2, run, "sfm", {});
  EXPECT_EQ(ExitOf(first), static_cast<int>(ExitCode::kNotReconstructible)) << Said(0);
  EXPECT_EQ(ExitOf(second), 0) << Said(1);
  EXPECT_EQ(Said(1), "");
}

TEST_F(Ranks, AKilledRankIsNamedAndAnyNumberContinues) {
  const fs::path cut = Copy("cut"), straight = Copy("straight");
  const std::vector<std::string> train = {"--steps=70"};
  const pid_t first = Start(0, 2, cut, "train", train), second = Start(1, 2, cut, "train", train);
  while (!fs::exists(cut / ".train.partial") && waitpid(first, nullptr, WNOHANG) == 0)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  kill(second, SIGKILL);
  EXPECT_EQ(ExitOf(second), 128 + SIGKILL);
  EXPECT_EQ(ExitOf(first), static_cast<int>(ExitCode::kLostRank));
  EXPECT_THAT(Said(0), HasSubstr("error E11: rank 1 ("));
  EXPECT_FALSE(fs::exists(cut / "train/train.json"));
  Run(1, cut, "train", train);
  Run(1, straight, "train", train);
  EXPECT_TRUE(Trained(cut) == Trained(straight));
}

TEST_F(Ranks, OtherOptionsAreRefused) {
  const fs::path run = Copy("mixed");
  const pid_t first = Start(0, 2, run, "train", {"--steps=30"}),
              second = Start(1, 2, run, "train", {"--steps=31"});
  EXPECT_EQ(ExitOf(second), static_cast<int>(ExitCode::kUsage)) << Said(1);
  EXPECT_EQ(ExitOf(first), static_cast<int>(ExitCode::kLostRank)) << Said(0);
  EXPECT_THAT(Said(1), HasSubstr("rank 1 differs from rank 0"));
  EXPECT_THAT(Said(0), HasSubstr("rank 1 ("));
  EXPECT_FALSE(fs::exists(run / "train"));
}

TEST_F(Ranks, TheOriginalNetworkTrainsOnOne) {
  const fs::path run = Copy("run2");
  const pid_t first = Start(0, 2, run, "train", {"--field=nerf"}),
              second = Start(1, 2, run, "train", {"--field=nerf"});
  EXPECT_EQ(ExitOf(first), static_cast<int>(ExitCode::kUsage)) << Said(0);
  EXPECT_EQ(ExitOf(second), static_cast<int>(ExitCode::kUsage)) << Said(1);
  EXPECT_THAT(Said(0), HasSubstr("--field nerf trains on one rank"));
}

TEST_F(Ranks, ARankThatIsThereAlreadyIsRefused) {
  const fs::path run = Copy("run3");  // waits for rank 2
  std::vector<pid_t> pids;
  for (const int rank : {0, 1, 1}) pids.push_back(Start(rank, 3, run, "train", {}));
  int status = 0;
  const pid_t twin = waitpid(-1, &status, 0);
  EXPECT_TRUE(twin == pids[1] || twin == pids[2]);
  EXPECT_EQ(WEXITSTATUS(status), static_cast<int>(ExitCode::kLocked));
  for (const pid_t pid : pids) {
    if (pid == twin) continue;
    kill(pid, SIGKILL);
    waitpid(pid, &status, 0);
  }
}

TEST_F(Ranks, TheEnvironmentIsCheckedAndThePortNamed) {
  const fs::path run = Copy("run2");
  EXPECT_EQ(ExitOf(Start(2, 2, run, "train", {})), static_cast<int>(ExitCode::kUsage));
  EXPECT_THAT(Said(2), HasSubstr("RANK=2: no whole number from 0 to 1"));
  EXPECT_EQ(ExitOf(Start(0, 2, "", "train", {})), static_cast<int>(ExitCode::kUsage));
  EXPECT_THAT(Said(0), HasSubstr("--out DIR is missing"));
  const io::ProcessReport report = io::RunProcess(
      {"/usr/bin/env", "-u", "RANK", "WORLD_SIZE=2", Program("train").string(), "--out=" + run.string()},
      {.timeout_s = 60, .log_path = Log(1)});
  EXPECT_EQ(report.exit_code, static_cast<int>(ExitCode::kUsage));
  EXPECT_THAT(Said(1), HasSubstr("RANK is not set"));
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{
      .sin_family = AF_INET, .sin_port = htons(static_cast<std::uint16_t>(port_)), .sin_addr = {}};
  ASSERT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  ASSERT_EQ(listen(fd, 1), 0);
  EXPECT_EQ(ExitOf(Start(0, 2, run, "train", {})), static_cast<int>(ExitCode::kLocked));
  EXPECT_THAT(Said(0), HasSubstr("choose another MASTER_PORT"));
  close(fd);
}

}  // namespace
