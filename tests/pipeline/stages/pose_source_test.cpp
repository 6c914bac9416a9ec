// Poses that cannot be used are refused by name: models without pictures, pictures that are not the model's,
// splits of two origins.
#include "pipeline/stages/pose_source.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/image/image.h"
#include "io/scene/transforms.h"
#include "tests/support/files/picture_scene.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;

// Two pictures of 16 x 12 pixels, a.png and b.png, and a model in COLMAP's text format that poses them and
// one point.
class PoseSource : public testing::Test {
 protected:
  PoseSource() {
    for (const char* name : {"a.png", "b.png"})
      io::WriteImage(dir_ / "images" / name, io::MakeImage(16, 12, 3));
    fs::create_directories(model_);
    WriteText(model_ / "cameras.txt", "1 PINHOLE 16 12 20 20 8 6\n");
    WriteText(model_ / "images.txt", "1 1 0 0 0 0 0 0 1 a.png\n8 6 1\n2 1 0 0 0 1 0 0 1 b.png\n9 6 1\n");
    WriteText(model_ / "points3D.txt", "1 0 0 9 7 7 7 0.1 1 0 2 0\n");
  }

  TempDir dir_;
  const fs::path model_ = dir_ / "sparse/0", images_ = dir_ / "images";
};

TEST_F(PoseSource, PicturesBesideAModelAreFound) {
  const pipeline::PoseSource source = pipeline::ReadPoses(model_, "");
  ASSERT_EQ(source.scene.frames.size(), 2u);
  EXPECT_EQ(source.scene.frames[0].image_path, images_ / "a.png");
  EXPECT_EQ(source.scene.points.size(), 1u);
}

TEST_F(PoseSource, WhatHoldsNoPosesIsRefused) {
  fs::create_directories(dir_ / "empty");
  for (const char* name : {"empty", "absent", "images"})
    EXPECT_ERROR(pipeline::ReadPoses(dir_ / name, ""), io::ExitCode::kBadInput, name, "holds no poses");
}

TEST_F(PoseSource, AModelThatPosesNothingIsRefused) {
  WriteText(model_ / "images.txt", "");
  WriteText(model_ / "points3D.txt", "");
  EXPECT_ERROR(pipeline::ReadPoses(model_, ""), io::ExitCode::kBadInput, "sparse/0", "poses no picture");
}

TEST_F(PoseSource, AModelWithoutItsPicturesIsRefused) {
  fs::create_directories(dir_ / "others");
  EXPECT_ERROR(pipeline::ReadPoses(model_, dir_ / "others"),
               io::ExitCode::kBadInput,
               "others",
               "first a.png",
               "--images DIR");
  fs::remove_all(images_);
  EXPECT_ERROR(pipeline::ReadPoses(model_, ""),
               io::ExitCode::kBadInput,
               "its pictures were not found",
               "--images DIR");
}

TEST_F(PoseSource, PicturesOfAnotherSizeThanTheModelSaysAreRefused) {
  io::WriteImage(images_ / "b.png", io::MakeImage(10, 10, 3));
  EXPECT_ERROR(pipeline::ReadPoses(model_, ""),
               io::ExitCode::kBadInput,
               "b.png",
               "is 10 x 10, but its camera 16 x 12");
}

TEST_F(PoseSource, SplitsOfTwoOriginsAreRefused) {
  io::WriteTransforms(dir_ / "transforms_train.json", tests::SceneOf({images_ / "a.png"}, 16, 12), "");
  EXPECT_EQ(pipeline::ReadPoses(dir_.path(), "").scene.frames.size(), 1u);
  // As NeRF-synthetic has them: the angle of view is the whole camera.
  WriteText(dir_ / "transforms_test.json",
            R"({"camera_angle_x": 0.7, "frames": [{"file_path": "./images/b",
                "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]}]})");
  EXPECT_ERROR(pipeline::ReadPoses(dir_.path(), ""),
               io::ExitCode::kBadInput,
               "transforms_test.json",
               "another dialect than transforms_train.json");
}

TEST_F(PoseSource, AStageOfSfmThatDidNotRunOrLostItsTracksIsNamed) {
  const fs::path sfm = dir_ / "sfm";
  EXPECT_ERROR(
      pipeline::ReadSfmPoses(sfm), io::ExitCode::kBadInput, "no such file", "Run `pipeline sfm` first");
  io::WriteImage(sfm / "images/a.png", io::MakeImage(16, 12, 3));
  io::WriteTransforms(sfm / "transforms.json", tests::SceneOf({sfm / "images/a.png"}, 16, 12), "");
  EXPECT_EQ(pipeline::ReadSfmPoses(sfm).scene.frames.size(), 1u);
  fs::rename(dir_ / "sparse", sfm / "sparse");
  EXPECT_EQ(pipeline::ReadSfmPoses(sfm).scene.points.size(), 1u);
  WriteText(sfm / "sparse/0/images.txt", "1 1 0 0 0 0 0 0 1 c.png\n8 6 1\n2 1 0 0 0 1 0 0 1 d.png\n9 6 1\n");
  EXPECT_ERROR(pipeline::ReadSfmPoses(sfm), io::ExitCode::kBadState, "observes none of the pictures");
}

}  // namespace
