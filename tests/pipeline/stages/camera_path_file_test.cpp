#include "pipeline/stages/camera_path_file.h"

#include <gtest/gtest.h>

#include <numbers>

#include "io/base/error.h"
#include "tests/support/temp_dir.h"

namespace pipeline {
namespace {

constexpr char kIdentity[] = "[1,0,0,0, 0,1,0,0, 0,0,1,5, 0,0,0,1]";

// A file with these members besides the size.
std::string File(const std::string& members) {
  return R"({"render_width": 640, "render_height": 480, "fps": 24, "seconds": 0.5, )" + members + "}";
}
std::string View(const std::string& matrix_key, const std::string& matrix, const std::string& fov = "50") {
  return "{\"" + matrix_key + "\": " + matrix + ", \"fov\": " + fov + ", \"aspect\": 1.333}";
}
std::string Frames(const std::string& view) { return File("\"camera_path\": [" + view + ", " + view + "]"); }

TEST(CameraPathFile, WrittenPathsAreReadBack) {
  const TempDir dir;
  CameraPathFile file{.width = 1280, .height = 720, .fps = 25, .is_loop = true};
  nerf::Keyframe view{.fov_y = 0.9};
  view.world_from_cam.translation = {1, -2, 3.5};
  view.world_from_cam.rotation = Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  file.keyframes = {view};
  file.frames = {view, view, view};
  WriteCameraPath(dir / "path.json", file);
  const CameraPathFile read = ReadCameraPath(dir / "path.json");
  EXPECT_EQ(read.width, 1280);
  EXPECT_EQ(read.height, 720);
  EXPECT_EQ(read.fps, 25);
  EXPECT_TRUE(read.is_loop);
  ASSERT_EQ(read.keyframes.size(), 1u);
  ASSERT_EQ(read.frames.size(), 3u);
  EXPECT_LT((read.frames[2].world_from_cam.rotation - view.world_from_cam.rotation).norm(), 1e-12);
  EXPECT_EQ(read.frames[2].world_from_cam.translation, view.world_from_cam.translation);
  EXPECT_NEAR(read.frames[2].fov_y, 0.9, 1e-12);
}

TEST(CameraPathFile, MatricesStandByRowsAndAnglesInDegrees) {
  const CameraPathFile file = ParseCameraPath(Frames(View("camera_to_world", kIdentity, "90")), "p");
  EXPECT_EQ(file.frames[1].world_from_cam.translation.z(), 5);
  EXPECT_NEAR(file.frames[1].fov_y, std::numbers::pi / 2, 1e-12);
}

TEST(CameraPathFile, KeyframesAloneBecomeFrames) {
  const CameraPathFile file =
      ParseCameraPath(File("\"keyframes\": [" + View("matrix", kIdentity) + "]"), "p");
  EXPECT_EQ(file.frames.size(), 12u);
}

TEST(CameraPathFile, RefusesWhatCannotBeFilmed) {
  const std::string frames = Frames(View("camera_to_world", kIdentity));
  const auto with = [&](const std::string& member) {
    return frames.substr(0, frames.size() - 1) + ", " + member + "}";
  };
  const auto refused = [](const std::string& text, const std::string& place) {
    EXPECT_ERROR(ParseCameraPath(text, "p"), io::ExitCode::kBadInput, "p", place);
  };
  refused("{", "line");
  refused(File("\"keyframes\": []"), "camera_path");
  refused(File("\"camera_path\": []"), "camera_path");
  refused(Frames(View("camera_to_world", "[1,0,0]")), "camera_path[0].camera_to_world");
  refused(Frames(View("camera_to_world", "[2,0,0,0, 0,1,0,0, 0,0,1,5]")), "rigid");
  refused(Frames(View("camera_to_world", "[-1,0,0,0, 0,1,0,0, 0,0,1,5]")), "rigid");
  refused(Frames(View("camera_to_world", kIdentity, "0")), "fov");
  refused(Frames(View("camera_to_world", kIdentity, "180")), "fov");
  refused(with("\"camera_type\": \"fisheye\""), "camera_type");
  refused(with("\"crop\": {}"), "crop");
  EXPECT_NO_THROW(ParseCameraPath(with("\"crop\": null, \"camera_type\": \"perspective\""), "p"));
}

}  // namespace
}  // namespace pipeline
