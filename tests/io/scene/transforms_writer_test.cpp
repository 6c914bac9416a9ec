// transforms.json: what we write comes back bit for bit, and other programs can read it.
#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/image/image.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "tests/support/files/transforms_folder.h"
#include "tests/support/scenes/scene_matchers.h"

namespace {

namespace fs = std::filesystem;

using TransformsWriter = TransformsFolder;

TEST_F(TransformsWriter, WrittenSceneComesBackExactly) {
  io::Scene scene = AwkwardScene(folder_);
  scene.near = 2.1;
  scene.far = 6.3;
  scene.aabb = {{-1.1, -1, -1}, {1, 1, 1.3}};
  scene.unbounded = true;
  scene.scene_from_sfm = {1.0 / 3, scene.frames[1].world_from_cam.rotation, {1e-3, 2, 3}};
  scene.points.resize(1);
  scene.points[0].xyz = {1, 2, 3};
  io::WritePly(folder_ / "points.ply", scene.points);
  io::WriteTransforms(json_, scene, "points.ply");

  const io::TransformsFile file = io::ReadTransforms(json_);
  EXPECT_EQ(file.dialect, io::TransformsDialect::kNerfstudio);
  EXPECT_TRUE(file.has_near_far);
  EXPECT_TRUE(file.notes.empty()) << file.notes[0];
  EXPECT_TRUE(file.missing_images.empty());
  EXPECT_THAT(file.scene, tests::SceneNear(scene, 0));
}

TEST_F(TransformsWriter, CamerasThatDifferAreWrittenInEveryFrameAndNotOnTop) {
  io::Scene scene = AwkwardScene(folder_);
  scene.cameras.push_back(scene.cameras[0]);
  scene.cameras[1].k1 = 0.1;
  scene.frames[1].camera_index = 1;
  io::WriteTransforms(json_, scene, "");
  const std::string text = io::ReadFile(json_);
  const std::size_t first = text.find("\"fl_x\""), second = text.find("\"fl_x\"", first + 1);
  EXPECT_GT(first, text.find("\"frames\""));
  EXPECT_NE(second, std::string::npos);
  const io::TransformsFile file = io::ReadTransforms(json_);
  EXPECT_EQ(file.scene.cameras, scene.cameras);
  EXPECT_EQ(file.scene.frames[1].camera_index, 1);
  EXPECT_FALSE(file.has_near_far);
}

TEST_F(TransformsWriter, WritesTheKeysThatOtherReadersNeedAndNoneThatMislead) {
  io::Scene scene = AwkwardScene(folder_);
  scene.aabb = {{-1, -1, -1}, {1, 1, 1}};
  io::WritePly(folder_ / "points.ply", {});
  io::WriteTransforms(json_, scene, "points.ply");
  const std::string text = io::ReadFile(json_);
  for (const char* key : {"\"camera_model\": \"OPENCV\"",
                          "\"fl_x\"",
                          "\"fl_y\"",
                          "\"cx\"",
                          "\"cy\"",
                          "\"w\"",
                          "\"h\"",
                          "\"k1\": 0.0",
                          "\"k2\": 0.0",
                          "\"p1\": 0.0",
                          "\"p2\": 0.0",
                          "\"camera_angle_x\"",
                          "\"ply_file_path\": \"points.ply\"",
                          "\"applied_transform\"",
                          "\"file_path\": \"images/a.png\""}) {
    EXPECT_NE(text.find(key), std::string::npos) << key;
  }
  // One space of indentation is the top level, where instant-ngp gives these names a meaning of its own.
  for (const char* key : {"\n \"aabb\"", "\n \"scale\"", "\n \"offset\"", "\n \"near\""})
    EXPECT_EQ(text.find(key), std::string::npos) << key;
}

TEST_F(TransformsWriter, MasksComeBackAndMayBeMissingFromSomeFrames) {
  io::WriteImage(folder_ / "masks/a.png", io::MakeImage(kWidth, kHeight, 3));
  io::Scene scene = AwkwardScene(folder_);
  scene.frames[0].mask_path = folder_ / "masks/a.png";
  io::WriteTransforms(json_, scene, "");
  EXPECT_NE(io::ReadFile(json_).find("\"mask_path\": \"masks/a.png\""), std::string::npos);
  const io::TransformsFile file = io::ReadTransforms(json_);
  EXPECT_TRUE(file.notes.empty()) << file.notes[0];
  ASSERT_EQ(file.scene.frames.size(), 2u);
  EXPECT_EQ(file.scene.frames[0].mask_path, folder_ / "masks/a.png");
  EXPECT_EQ(file.scene.frames[1].mask_path, "");
  scene.frames[1].mask_path = folder_.parent_path() / "outside.png";
  EXPECT_THROW(io::WriteTransforms(json_, scene, ""), io::Error);
}

TEST_F(TransformsWriter, NerfSyntheticDialectComesBack) {
  io::Scene scene = AwkwardScene(folder_);
  const io::Camera other = scene.cameras[0];
  scene.cameras[0] = {.width = other.width, .height = other.height, .fl_x = 30, .fl_y = 30};
  scene.cameras[0].cx = 0.5 * other.width, scene.cameras[0].cy = 0.5 * other.height;
  io::WriteBlenderTransforms(json_, scene);
  const std::string text = io::ReadFile(json_);
  EXPECT_EQ(text.find(".png"), std::string::npos);  // readers add it
  EXPECT_EQ(text.find("fl_x"), std::string::npos);
  io::TransformsFile file = io::ReadTransforms(json_);
  EXPECT_EQ(file.dialect, io::TransformsDialect::kBlender);
  EXPECT_NEAR(file.scene.cameras[0].fl_x, 30, 1e-12);
  file.scene.cameras[0].fl_x = file.scene.cameras[0].fl_y = 30;
  EXPECT_THAT(file.scene, tests::SceneNear(scene, 0));

  // What the angle does not say stands beside it.
  scene.cameras[0] = other;
  io::WriteBlenderTransforms(json_, scene);
  EXPECT_THAT(io::ReadTransforms(json_).scene, tests::SceneNear(scene, 0));
  scene.cameras.push_back(other);
  scene.cameras[1].fl_x += 1;
  scene.frames[1].camera_index = 1;
  io::WriteBlenderTransforms(json_, scene);
  EXPECT_THAT(io::ReadTransforms(json_).scene, tests::SceneNear(scene, 0));
}

TEST_F(TransformsWriter, RefusesToWriteAPictureOutsideTheFolder) {
  io::Scene scene = AwkwardScene(folder_ / "elsewhere");
  EXPECT_THROW(io::WriteTransforms(folder_ / "x/transforms.json", scene, ""), io::Error);
}

}  // namespace
