#include "pipeline/stages/trained_scene.h"

#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "pipeline/stage/options.h"
#include "pipeline/stages/stages.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;
using io::ExitCode;

class TrainedScene : public testing::Test {
 protected:
  TrainedScene() {
    io::ClaimFolder(run_);
    WriteText(run_ / "scene/transforms_train.json", "poses");
    WriteText(run_ / "scene/a.png", "picture");
    Run("train", {run_ / "scene"}, [](const pipeline::StageRun& stage) {
      WriteText(stage.folder() / "checkpoint.bin", "field");
    });
  }
  template <typename Body>
  void Run(const char* name, const std::vector<fs::path>& inputs, const Body& body) {
    const pipeline::CommonOptions common{.out = run_};
    const pipeline::Options options(name, "");
    pipeline::StageRun stage(name, common, options, inputs);
    body(stage);
    stage.Finish();
  }
  void Evaluate() {
    Run("evaluate", {run_ / "scene", checkpoint_}, [&](const pipeline::StageRun& stage) {
      pipeline::RequireTrainedOnThisScene(stage, checkpoint_);
    });
  }

  TempDir dir_;
  fs::path run_ = dir_ / "run";
  fs::path checkpoint_ = run_ / "train/checkpoint.bin";
};

TEST_F(TrainedScene, WhatTrainWroteFromTheseFilesIsAccepted) {
  EXPECT_NO_THROW(Evaluate());
  WriteText(run_ / "scene/new.png", "that training did not know");
  EXPECT_NO_THROW(Evaluate());
}

TEST_F(TrainedScene, AnotherCheckpointIsRefused) {
  WriteText(checkpoint_, "field of another scene");
  EXPECT_ERROR(
      Evaluate(), ExitCode::kBadState, checkpoint_.string(), "not the checkpoint that `train` wrote");
}

TEST_F(TrainedScene, AnotherSceneIsRefused) {
  WriteText(run_ / "scene/transforms_train.json", "other poses");
  EXPECT_ERROR(Evaluate(), ExitCode::kBadState, "scene/transforms_train.json: differs", "train again");
}

TEST_F(TrainedScene, ACheckpointWithoutItsRecordIsRefused) {
  for (const char* record : {"", "[]", "{}", R"({"outputs": 7})", R"({"outputs": {"checkpoint.bin": 7}})"}) {
    WriteText(run_ / "train/train.json", record);
    EXPECT_ERROR(Evaluate(), ExitCode::kBadState, "not the checkpoint");
  }
}

// The field's kind is read before anything else, to decide about LibTorch: a missing checkpoint is no damaged
// one.
TEST(StagesAfterTraining, WithoutTrainingTheMissingInputIsNamed) {
  const TempDir dir;
  const std::string out = dir.path().string();
  const char* const argv[] = {"pipeline-evaluate", "--out", out.c_str()};
  EXPECT_EQ(pipeline::RunEvaluate(3, argv), static_cast<int>(ExitCode::kBadInput));
  EXPECT_EQ(pipeline::RunRender(3, argv), static_cast<int>(ExitCode::kBadInput));
}

}  // namespace
