// What can be seen of a run while it grows.
#include "pipeline/view/live_run.h"

#include <gtest/gtest.h>

#include <chrono>
#include <functional>

#include "io/base/error.h"
#include "tests/support/files/small_run.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using tests::SmallRun;

// Whether it holds within ten seconds.
bool Soon(const std::function<bool()>& holds) {
  for (int i = 0; i < 1000; ++i) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

TEST(LiveRun, FollowsAnEmptyFolderToPointsAndFields) {
  const SmallRun small;
  const fs::path scene = small.path() / "scene", away = small.path() / "away";
  fs::rename(scene, away);
  LiveRun run(small.path(), 1);
  EXPECT_FALSE(run.Now().scene);
  fs::rename(away, scene);
  ASSERT_TRUE(Soon([&] { return run.Now().scene != nullptr; }));
  EXPECT_FALSE(run.Now().field);
  small.Train(".train.partial");
  ASSERT_TRUE(Soon([&] { return run.Now().field != nullptr; }));
  EXPECT_FALSE(run.Now().is_finished);
  const std::uint64_t version = run.Now().version;
  fs::rename(small.path() / ".train.partial", small.path() / "train");
  ASSERT_TRUE(Soon([&] { return run.Now().is_finished; }));
  EXPECT_GT(run.Now().version, version);
  ASSERT_TRUE(Soon([&] { return run.Now().support != nullptr; }));
  EXPECT_EQ(run.Now().fault, "");
}

TEST(LiveRun, NamesADamagedCheckpointAtTheStartAndWhileItFollows) {
  const SmallRun small;
  LiveRun run(small.path(), 1);
  WriteText(small.path() / "train/checkpoint.bin", "no checkpoint");
  ASSERT_TRUE(Soon([&] { return !run.Now().fault.empty(); }));
  EXPECT_NE(run.Now().fault.find("checkpoint.bin"), std::string::npos);
  EXPECT_ERROR(LiveRun(small.path(), 1), io::ExitCode::kBadState, "checkpoint.bin");
}

TEST(LiveRun, RefusesWhatIsNoFolder) {
  const TempDir dir;
  EXPECT_ERROR(LiveRun(dir / "absent", 1), io::ExitCode::kBadInput, "absent");
}

}  // namespace
}  // namespace pipeline
