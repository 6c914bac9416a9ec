#include "pipeline/film/camera_path_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

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

std::string Crop(const std::string& centre,
                 const std::string& size,
                 const std::string& rotation = "[0,0,0]") {
  return "{\"crop_center\": " + centre + ", \"crop_scale\": " + size + ", \"crop_rot\": " + rotation +
         ", \"crop_bg_color\": {\"r\": 255, \"g\": 0, \"b\": 51}}";
}

TEST(CameraPathFile, CropBoxesTurnAboutXThenYThenZ) {
  const pipeline::Crop crop = ParseCrop(Crop("[1,2,3]", "[4,5,6]", "[0.5,0,1.5707963267948966]"), "p");
  EXPECT_EQ(crop.box.world_from_box.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(crop.box.size, Eigen::Vector3d(4, 5, 6));
  EXPECT_LT((crop.box.world_from_box.rotation.col(0) - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  EXPECT_LT(
      (crop.box.world_from_box.rotation.col(1) - Eigen::Vector3d(-std::cos(0.5), 0, std::sin(0.5))).norm(),
      1e-12);
  EXPECT_EQ(crop.background, (std::array<float, 3>{1, 0, 0.2f}));
}

TEST(CameraPathFile, CropBoxesAreReadBackWithAndWithoutFrames) {
  const TempDir dir;
  CameraPathFile file{.width = 640, .height = 480};
  file.crop = ParseCrop(Crop("[1,2,3]", "[4,5,6]", "[0.3,-0.4,2.5]"), "p");
  WriteCameraPath(dir / "crop.json", file);
  EXPECT_ERROR(ReadCameraPath(dir / "crop.json"), io::ExitCode::kBadInput, "no frames");
  file.frames.resize(2, {.world_from_cam = {}, .fov_y = 1});
  WriteCameraPath(dir / "path.json", file);
  EXPECT_EQ(ReadCameraPath(dir / "path.json").frames.size(), 2u);
  for (const char* name : {"crop.json", "path.json"}) {
    const pipeline::Crop read = ReadCrop(dir / name);
    EXPECT_EQ(read.box.size, file.crop->box.size);
    EXPECT_LT((read.box.world_from_box.rotation - file.crop->box.world_from_box.rotation).norm(), 1e-12);
    EXPECT_EQ(read.background, file.crop->background);
  }
  file.crop.reset();
  WriteCameraPath(dir / "path.json", file);
  EXPECT_ERROR(ReadCrop(dir / "path.json"), io::ExitCode::kBadInput, "no crop box");
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
  refused(with("\"crop\": " + Crop("[0,0]", "[1,1,1]")), "crop_center");
  refused(with("\"crop\": " + Crop("[0,0,0,0]", "[1,1,1]")), "crop_center");
  refused(with("\"crop\": " + Crop("[0,0,0]", "[1,0,1]")), "crop_scale");
  refused(with("\"crop\": " + Crop("[0,0,0]", "[1,1,1]", "[0,0,9]")), "crop_rot");
  EXPECT_NO_THROW(ParseCameraPath(with("\"crop\": null, \"camera_type\": \"perspective\""), "p"));
}

}  // namespace
}  // namespace pipeline
