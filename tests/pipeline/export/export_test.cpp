// The command: every export of a small trained run in one call, and what it refuses before any work.
#include "pipeline/export/export.h"
#include "io/base/json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "io/base/error.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "nerf/fields/checkpoint.h"
#include "tests/support/files/small_run.h"
#include "tests/support/files/sphere_export.h"
#include "tests/support/scenes/some_splats.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::ExitCode;
using testing::HasSubstr;

class ExportCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    small_ = new tests::SmallRun();
    small_->Train("train");
    small_->RecordTraining();
  }
  static void TearDownTestSuite() { delete small_; }

  // The exit code; what was printed is in output_ and error_.
  int Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"pipeline export", small_->path().string()});
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int code = RunExport(static_cast<int>(argv.size()), argv.data());
    output_ = testing::internal::GetCapturedStdout();
    error_ = testing::internal::GetCapturedStderr();
    return code;
  }
  void ExpectRefused(ExitCode code, const std::vector<std::string>& arguments, const std::string& text) {
    EXPECT_EQ(Run(arguments), static_cast<int>(code)) << error_;
    EXPECT_THAT(error_, HasSubstr(text));
    EXPECT_EQ(CountEntries(dir_.path()), 0) << text;
  }
  // That of every training view in the folder d, as a place with x above `least`.
  void ExpectDepthBeyond(double least) const {
    const auto record = io::ParseJson(ReadText(dir_ / "d/depth.json"));
    const io::Scene scene = io::ReadTransforms(small_->path() / "scene/transforms_train.json").scene;
    int n = 0;
    for (std::size_t i = 0; i < scene.frames.size(); ++i) {
      const std::string name = record["frames"][i]["name"];
      const cv::Mat depth = cv::imread((dir_ / "d/depth" / name).string(), cv::IMREAD_UNCHANGED);
      for (int y = 0; y < depth.rows; ++y) {
        for (int x = 0; x < depth.cols; ++x) {
          if (depth.at<std::uint16_t>(y, x) == 0) continue;
          const double z = record["scale"].get<double>() * depth.at<std::uint16_t>(y, x);
          const Eigen::Vector3d ray = *io::RayFromImg(scene.cameras[0], {x + 0.5, y + 0.5});
          EXPECT_GT((scene.frames[i].world_from_cam * Eigen::Vector3d(ray * (z / -ray.z()))).x(), least);
          ++n;
        }
      }
    }
    EXPECT_GT(n, 100);
  }
  std::string Path(const std::string& name) const { return (dir_ / name).string(); }

  static inline tests::SmallRun* small_ = nullptr;
  const TempDir dir_;
  std::string output_, error_;
};

TEST_F(ExportCommand, WritesAllKindsInOneCall) {
  ASSERT_EQ(Run({"--cameras=" + Path("c"),
                 "--points=" + Path("p.ply"),
                 "--depth=" + Path("d"),
                 "--splats=" + Path("s.ply"),
                 "--mesh=" + Path("m.glb"),
                 "--max-points=2000",
                 "--max-splats=1000",
                 "--splat-steps=20",
                 "--threads=2",
                 "--points-apart=0,0,0,0,0,1=2"}),
            0)
      << error_;
  EXPECT_EQ(io::ReadTransforms(dir_ / "c/transforms.json").scene.frames.size(), 8u);
  EXPECT_FALSE(fs::exists(dir_ / "c/transforms_test.json"));  // the run has no test views
  EXPECT_TRUE(fs::exists(dir_ / "d/depth.json"));
  const std::vector<io::Point3D> points = io::ReadPly(dir_ / "p.ply");
  EXPECT_GT(points.size(), 500u);
  EXPECT_LE(points.size(), 2000u);
  // A ball of radius 0.8, doubled; after few steps the field is soft.
  std::vector<double> radii;
  for (const io::Point3D& point : points) radii.push_back(point.xyz.norm());
  std::nth_element(radii.begin(), radii.begin() + static_cast<long>(radii.size() / 2), radii.end());
  EXPECT_NEAR(radii[radii.size() / 2], 1.6, 0.25);
  const std::size_t n_splats = tests::PlyColumns(dir_ / "s.ply")["opacity"].size();
  EXPECT_GT(n_splats, 100u);
  EXPECT_LT(n_splats, 1100u);
  EXPECT_THAT(output_, HasSubstr("splats  " + Path("s.ply") + "  " + std::to_string(n_splats) + " splats"));

  EXPECT_THAT(ReadText(dir_ / "m.glb").substr(0, 4), "glTF");
  ASSERT_EQ(Run({"--mesh=" + Path("m.glb")}), 0) << error_;  // over the first one

  // The same bytes for another number of threads, over the first files.
  const std::string points_before = ReadText(dir_ / "p.ply"), splats_before = ReadText(dir_ / "s.ply");
  ASSERT_EQ(Run({"--points=" + Path("p.ply"),
                 "--splats=" + Path("s.ply"),
                 "--max-points=2000",
                 "--max-splats=1000",
                 "--splat-steps=20",
                 "--threads=1",
                 "--points-apart=0,0,0,0,0,1=2"}),
            0)
      << error_;
  EXPECT_EQ(ReadText(dir_ / "p.ply"), points_before);
  EXPECT_EQ(ReadText(dir_ / "s.ply"), splats_before);
}

TEST_F(ExportCommand, SplatsOfTheTrainingAreWrittenUnlessOthersAreAskedFor) {
  const fs::path checkpoint = small_->path() / "train/checkpoint.bin";
  const std::string before = ReadText(checkpoint);
  nerf::TrainState state;
  const auto scene_field = nerf::ReadCheckpoint(checkpoint, &state);
  scene_field->splats = tests::SomeSplats(37);
  nerf::WriteCheckpoint(checkpoint, scene_field.get(), state);
  small_->RecordTraining();
  EXPECT_EQ(Run({"--splats=" + Path("own.ply")}), 0) << error_;
  EXPECT_EQ(Run({"--splats=" + Path("other.ply"), "--max-splats=1000", "--splat-steps=0"}), 0) << error_;
  WriteText(checkpoint, before);
  small_->RecordTraining();
  const auto own = tests::PlyColumns(dir_ / "own.ply");
  ASSERT_EQ(own.at("x").size(), 37u);
  for (std::size_t i = 0; i < 37; ++i)
    EXPECT_NEAR(own.at("y")[i], scene_field->splats.places[3 * i + 1], 1e-6);
  EXPECT_GT(tests::PlyColumns(dir_ / "other.ply").at("x").size(), 100u);
}

TEST_F(ExportCommand, ACropBoxCutsAllThatTheFieldShows) {
  WriteText(dir_ / "crop.json",
            R"({"crop": {"crop_center": [1, 0, 0], "crop_scale": [2, 4, 4],
                         "crop_bg_color": {"r": 0, "g": 0, "b": 0}}})");
  ASSERT_EQ(Run({"--points=" + Path("p.ply"),
                 "--mesh=" + Path("m.ply"),
                 "--depth=" + Path("d"),
                 "--splats=" + Path("s.ply"),
                 "--max-splats=2000",
                 "--splat-steps=0",
                 "--crop=" + Path("crop.json")}),
            0)
      << error_;
  ExpectDepthBeyond(-0.1);
  const auto splats = tests::PlyColumns(dir_ / "s.ply");
  ASSERT_GT(splats.at("x").size(), 100u);
  for (const double x : splats.at("x")) EXPECT_GE(x, -0.1);  // less a sampling interval
  for (const char* name : {"p.ply", "m.ply"}) {
    const std::vector<io::Point3D> points = io::ReadPly(dir_ / name);
    ASSERT_GT(points.size(), 100u);
    for (const io::Point3D& point : points) EXPECT_GE(point.xyz.x(), -1e-5) << name;
  }
  WriteText(dir_ / "empty.json",
            R"({"crop": {"crop_center": [9, 0, 0], "crop_scale": [1, 1, 1],
                         "crop_bg_color": {"r": 0, "g": 0, "b": 0}}})");
  for (const char* target : {"--points=", "--mesh=", "--splats="})
    EXPECT_NE(Run({target + Path("none.ply"), "--crop=" + Path("empty.json")}), 0);
  EXPECT_FALSE(fs::exists(dir_ / "none.ply"));
}

// Turned by an eighth, the box lies beside the ball, but the box along the axes that holds it does not.
TEST_F(ExportCommand, WhatATurnedBoxLeavesOutIsNoMesh) {
  WriteText(dir_ / "turned.json",
            R"({"crop": {"crop_center": [1, 1, 0], "crop_scale": [0.6, 2.4, 1], "crop_rot": [0, 0, 0.785398],
                         "crop_bg_color": {"r": 0, "g": 0, "b": 0}}})");
  EXPECT_EQ(Run({"--mesh=" + Path("none.ply"), "--crop=" + Path("turned.json")}), 3) << error_;
  EXPECT_THAT(error_, HasSubstr("no surface lies in the crop box"));
  EXPECT_FALSE(fs::exists(dir_ / "none.ply"));
}

TEST_F(ExportCommand, WritesAPageAndReplacesOnlyItsOwn) {
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(Run({"--page=" + Path("scene.html")}), 0) << error_;
    EXPECT_THAT(output_, HasSubstr("page    " + Path("scene.html")));
  }
  EXPECT_THAT(ReadText(dir_ / "scene.html"), HasSubstr("a run"));
  WriteText(dir_ / "mine.html", "mine");
  EXPECT_EQ(Run({"--page=" + Path("mine.html")}), static_cast<int>(ExitCode::kBadInput));
  EXPECT_EQ(ReadText(dir_ / "mine.html"), "mine");
}

TEST_F(ExportCommand, OptionsAreCheckedBeforeAnyWork) {
  ExpectRefused(ExitCode::kUsage, {}, "nothing to export");
  for (const std::string flag : {"--frame=world",
                                 "--points-apart=1,2,3=1",
                                 "--max-points=0",
                                 "--max-splats=0",
                                 "--splat-steps=-1",
                                 "--view-size=-1",
                                 "--view-size=16385",
                                 "--threads=-1",
                                 "--cameras="})
    ExpectRefused(
        ExitCode::kUsage, {"--points=" + Path("a.ply"), flag}, flag.substr(0, flag.find('=')) + ": ");
  ExpectRefused(ExitCode::kUsage, {"--mesh=" + Path("a.obj")}, "is not named .glb or .ply");
  ExpectRefused(ExitCode::kUsage, {"--points=" + Path("a.obj"), "--cameras=" + Path("c")}, "a.obj");
  ExpectRefused(ExitCode::kUsage,
                {"--points=" + Path("c/a.ply"), "--cameras=" + Path("c")},
                "lies in that of --cameras");
  ExpectRefused(ExitCode::kUsage, {"--points=" + Path("a.ply"), "--splats=" + Path("a.ply")}, "lies in that");
  ExpectRefused(ExitCode::kUsage, {"--cameras=" + (small_->path() / "scene").string()}, "run folder");
}

TEST_F(ExportCommand, RunsThatLackSomethingAreNamed) {
  const fs::path train = small_->path() / "train", away = small_->path() / "away";
  fs::rename(train, away);
  ExpectRefused(ExitCode::kBadInput, {"--points=" + Path("a.ply")}, "train/checkpoint.bin: no such file");
  EXPECT_EQ(Run({"--cameras=" + Path("c")}), 0) << error_;  // needs no field
  fs::remove_all(dir_ / "c");
  fs::rename(away, train);
  const fs::path scene = small_->path() / "scene";
  fs::rename(scene, away);
  ExpectRefused(ExitCode::kBadInput, {"--cameras=" + Path("c")}, "transforms_train.json: no such file");
  fs::rename(away, scene);
}

TEST_F(ExportCommand, AFieldOfAnotherSceneIsRefused) {
  const fs::path poses = small_->path() / "scene/transforms_train.json";
  const std::string before = ReadText(poses);
  WriteText(poses, before + " ");
  ExpectRefused(ExitCode::kBadState, {"--depth=" + Path("d")}, "differs from what");
  WriteText(poses, before);
  WriteText(small_->path() / "train/train.json", "{}");
  ExpectRefused(ExitCode::kBadState, {"--depth=" + Path("d")}, "is not the checkpoint");
  small_->RecordTraining();
}

}  // namespace
}  // namespace pipeline
