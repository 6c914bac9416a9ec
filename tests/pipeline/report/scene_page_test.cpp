// The page that the report writes beside itself.
#include "pipeline/report/scene_page.h"

#include <gtest/gtest.h>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "pipeline/report/report.h"
#include "tests/support/files/small_run.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

int WriteReport(const fs::path& run) {
  const std::string out = run.string();
  const char* argv[] = {"pipeline report", "--out", out.c_str()};
  return RunReport(3, argv);
}

TEST(ScenePage, StandsBesideTheReportThatLinksIt) {
  const tests::SmallRun run;
  run.Train("train");
  WriteText(run.path() / "train/train.json", R"({"stage": "train", "status": "done"})");
  ASSERT_EQ(WriteReport(run.path()), 0);
  const fs::path page = ScenePagePath(run.path());
  EXPECT_NE(io::ReadFile(run.path() / "report.html").find("href=\"scene.html\""), std::string::npos);
  const std::string before = io::ReadFile(page);

  fs::remove(page);  // then it is written again ...
  ASSERT_EQ(WriteReport(run.path()), 0);
  EXPECT_EQ(io::ReadFile(page), before);
  const auto written = fs::last_write_time(page);
  ASSERT_EQ(WriteReport(run.path()), 0);  // ... and kept while nothing changes
  EXPECT_EQ(fs::last_write_time(page), written);

  fs::remove(run.path() / "train/checkpoint.bin");
  ASSERT_EQ(WriteReport(run.path()), 0);
  EXPECT_FALSE(fs::exists(page));
  EXPECT_EQ(io::ReadFile(run.path() / "report.html").find("href=\"scene.html\""), std::string::npos);
}

TEST(ScenePage, ADamagedCheckpointIsNoFieldThatBrowsersLack) {
  const tests::SmallRun run;
  run.Train("train");
  const fs::path checkpoint = run.path() / "train/checkpoint.bin";
  fs::resize_file(checkpoint, fs::file_size(checkpoint) - 1);
  EXPECT_ERROR(WriteScenePage(run.path()), io::ExitCode::kBadState, "checkpoint.bin");
}

}  // namespace
}  // namespace pipeline
