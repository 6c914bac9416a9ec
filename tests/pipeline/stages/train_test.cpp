// `pipeline train`: which pictures a target is measured on, and what is written of cameras and passers-by.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/json.h"
#include "io/base/owned_folder.h"
#include "io/image/mask.h"
#include "io/scene/transforms.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/stages/moved_cameras.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/trained_scene.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"
#include "tests/support/scenes/passers_by.h"
#include "tests/support/scenes/sphere_field.h"

namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class TrainTest : public testing::Test {
 protected:
  TrainTest() {
    scene_ = tests::RingScene(
        10, 40, 30, [&](int i) { return out_ / "scene/images" / ("v" + std::to_string(i) + ".png"); });
    io::ClaimFolder(out_);
    fs::create_directories(out_ / "scene/images");
    for (const io::Frame& frame : scene_.frames) {
      io::WriteImage(
          frame.image_path,
          pipeline::QuantizeView(tests::SphereField().Render(scene_.cameras[0], frame.world_from_cam, {})));
    }
    WriteSplit("train", 0, 10);
    WriteSplit("test", 0, 1);
  }

  void WriteSplit(const std::string& name, int begin, int end) {
    io::Scene part = scene_;
    part.frames.assign(scene_.frames.begin() + begin, scene_.frames.begin() + end);
    io::WriteTransforms(out_ / "scene" / ("transforms_" + name + ".json"), part, "");
  }

  // The decisions of a run with these flags, as one text.
  std::string Decisions(std::vector<std::string> flags) {
    flags.insert(flags.begin(), {"pipeline-train", "--out", out_.string(), "--threads=1", "--force"});
    std::vector<const char*> argv;
    for (const std::string& flag : flags) argv.push_back(flag.c_str());
    EXPECT_EQ(pipeline::RunTrain(static_cast<int>(argv.size()), argv.data()), 0);
    return io::DumpJson(io::ParseJson(io::ReadFile(out_ / "train/train.json"))["decisions"]);
  }

  TempDir dir_;
  fs::path out_ = dir_.path() / "run";
  io::Scene scene_;
};

TEST_F(TrainTest, ATargetIsMeasuredOnTrainingPicturesThatAreSetAside) {
  EXPECT_THAT(Decisions({"--target=1dB", "--time=5s"}), HasSubstr("on 1 of 10 training pictures"));
  EXPECT_THAT(Decisions({"--steps=2"}), Not(HasSubstr("set aside")));
}

TEST_F(TrainTest, OrOnTheValidationPicturesThatAreGiven) {
  WriteSplit("val", 3, 5);
  const std::string decisions = Decisions({"--target=1dB", "--time=5s"});
  EXPECT_THAT(decisions, HasSubstr("validation views at"));
  EXPECT_THAT(decisions, Not(HasSubstr("set aside")));
}

TEST_F(TrainTest, CamerasThatMovedAreWritten) {
  Decisions({"--steps=2"});
  EXPECT_EQ(io::ParseJson(io::ReadFile(out_ / "train/cameras.json"))["frames"], io::Json::array());

  io::Rigid3d pose;
  pose.rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  pose.translation << 2, 3, 4;
  pipeline::WriteMovedCameras(out_ / "cameras.json", {{"a.png", 1.5, pose}});
  const io::Json frame = io::ParseJson(io::ReadFile(out_ / "cameras.json"))["frames"].at(0);
  EXPECT_EQ(frame["name"], "a.png");
  EXPECT_EQ(frame["moved_px"], 1.5);
  EXPECT_EQ(frame["transform_matrix"], io::Json({{0, -1, 0, 2}, {1, 0, 0, 3}, {0, 0, 1, 4}, {0, 0, 0, 1}}));
}

TEST_F(TrainTest, WhatOnePictureAloneShowsBecomesMasks) {
  scene_ = tests::BallScene(out_ / "scene/images", 32, 0, {.behind = tests::Behind::kRoom});
  tests::PaintPassersBy(scene_);
  WriteSplit("train", 0, 32);
  const auto n_masks = [&] {
    const io::Scene trained = pipeline::ReadTrainingScene(out_);
    int n = 0;
    for (std::size_t i = 0; i < trained.frames.size(); ++i) {
      if (trained.frames[i].mask_path.empty()) continue;
      EXPECT_EQ(i % 3, 0u);
      EXPECT_LT(io::ReadMask(trained.frames[i].mask_path, 48, 48).UsedCount(), 48u * 48u - 50u);
      ++n;
    }
    return n;
  };
  const std::vector<std::string> flags = {"--steps=170",
                                          "--no-splats",
                                          "--batch=8192",
                                          "--log2-hashmap-size=12",
                                          "--finest-resolution=64",
                                          "--grid-resolution=64"};
  EXPECT_THAT(Decisions(flags), HasSubstr("show what the others do not"));
  EXPECT_GE(n_masks(), 8);
  std::vector<std::string> without = flags;
  without.push_back("--no-find-transients");
  EXPECT_THAT(Decisions(without), Not(HasSubstr("show what the others do not")));
  EXPECT_EQ(n_masks(), 0);
}

}  // namespace
