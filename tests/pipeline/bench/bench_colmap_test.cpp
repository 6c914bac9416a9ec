// COLMAP as the benchmark runs it, played by a stand-in.
#include "pipeline/bench/bench_colmap.h"

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/stand_in_colmap.h"

namespace pipeline {
namespace {

class ColmapPresetTest : public StandInColmap {
 protected:
  io::ColmapModel Run() {
    io::ResourceUse use;
    return RunColmapPreset({.name = "default"}, folder_ / "images", true, folder_ / "work", &use);
  }
};

TEST_F(ColmapPresetTest, AMissingProgramNamesTheRemedy) {
  setenv("PATH", folder_.c_str(), 1);
  EXPECT_ERROR(Run(), io::ExitCode::kMissingTool, "not found on PATH", "apt-get install colmap");
}

TEST_F(ColmapPresetTest, AFailureIsReportedWithTheLastLines) {
  Install("if [ $1 = exhaustive_matcher ]; then echo the last words; exit 1; fi");
  EXPECT_ERROR(Run(), io::ExitCode::kMissingTool, "colmap exhaustive_matcher failed", "the last words");
}

TEST_F(ColmapPresetTest, NoModelIsNoResult) {
  Install("exit 0");
  EXPECT_ERROR(Run(), io::ExitCode::kNotReconstructible, "no model");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "work"));
}

}  // namespace
}  // namespace pipeline
