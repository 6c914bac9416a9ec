// `pipeline sfm` refuses what it cannot work on before it begins.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "io/image/image.h"
#include "pipeline/stage/frames.h"
#include "pipeline/stages/stages.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class SfmStage : public testing::Test {
 protected:
  SfmStage() {
    io::ClaimFolder(run_);
    fs::create_directories(run_ / "ingest/images");
    pipeline::WriteFrames(
        run_ / "ingest/frames.json",
        {.kept = {{.name = "a.png", .source = "a.png", .width = 16, .height = 12}}, .dropped = {}});
  }

  // Expects the exit code, and the text in what the stage says.
  static void ExpectRefusal(std::vector<std::string> arguments, io::ExitCode code, const std::string& text) {
    arguments.insert(arguments.begin(), "pipeline-sfm");
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    testing::internal::CaptureStderr();
    const int exit_code = pipeline::RunSfm(static_cast<int>(argv.size()), argv.data());
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_EQ(exit_code, static_cast<int>(code)) << said;
    EXPECT_THAT(said, HasSubstr(text));
  }

  TempDir dir_;
  const fs::path run_ = dir_ / "run";
};

TEST_F(SfmStage, WithoutARunFolderOrItsPicturesThereIsNothingToDo) {
  ExpectRefusal({}, io::ExitCode::kUsage, "--out DIR is missing");
  ExpectRefusal({"--out", (dir_ / "other").string()}, io::ExitCode::kBadInput, "frames.json");
  ExpectRefusal({"--out", run_.string()}, io::ExitCode::kBadInput, "names images/a.png, which is missing");
}

TEST_F(SfmStage, MasksAreForTheDetectorThatCanUseThem) {
  io::WriteImage(run_ / "ingest/images/a.png", io::MakeImage(16, 12, 3));
  fs::create_directories(run_ / "ingest/masks");
  ExpectRefusal(
      {"--out", run_.string(), "--detector", "colmap"}, io::ExitCode::kUsage, "colmap's takes no masks");
}

}  // namespace
