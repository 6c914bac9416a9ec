// Cameras in the formats of other programs come back as the same poses, by our readers and by COLMAP.
#include "pipeline/export/cameras_export.h"

#include <gtest/gtest.h>

#include "io/process/process.h"
#include "io/scene/colmap_model.h"
#include "io/scene/transforms.h"
#include "tests/support/files/sphere_export.h"
#include "tests/support/programs/require_program.h"
#include "tests/support/scenes/scene_matchers.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

class CamerasExport : public testing::TestWithParam<const char*> {
 protected:
  CamerasExport() { ExportCameras(scene_, out_); }

  io::Rigid3d Expected(const io::Frame& frame) const {
    return io::TransformPose(scene_.target.target_from_scene, frame.world_from_cam);
  }
  // The frame that shows the picture of a file written.
  const io::Frame& FrameOf(const fs::path& picture) const {
    for (const io::Scene* part : {&scene_.train, &scene_.test}) {
      for (const io::Frame& frame : part->frames) {
        std::string name = frame.image_path.filename();
        std::replace(name.begin(), name.end(), ' ', '_');
        if (name == picture.filename()) return frame;
      }
    }
    throw std::runtime_error(picture.string() + " is no picture of the scene");
  }
  void ExpectPoses(const io::Scene& read, std::size_t n, double tolerance) const {
    ASSERT_EQ(read.frames.size(), n);
    for (const io::Frame& frame : read.frames) {
      EXPECT_THAT(frame.world_from_cam, tests::PoseNear(Expected(FrameOf(frame.image_path)), tolerance));
      const io::Camera& camera = read.cameras[static_cast<std::size_t>(frame.camera_index)];
      EXPECT_NEAR(camera.fl_x, scene_.train.cameras[0].fl_x, 1e-9);
      EXPECT_EQ(camera.cx, scene_.train.cameras[0].cx);
    }
  }
  void ExpectModel(const io::ColmapModel& model, double tolerance) const {
    ExpectPoses(model.scene, 20, tolerance);
    ASSERT_EQ(model.scene.points.size(), 30u);
    for (const io::Point3D& point : model.scene.points) {  // COLMAP gives them another order
      const io::Point3D& original = scene_.train.points.at(point.rgb[2]);
      EXPECT_LT((point.xyz - scene_.target.target_from_scene * original.xyz).norm(), tolerance);
      EXPECT_EQ(point.rgb, original.rgb);
      EXPECT_EQ(point.frame_indices.size(), 2u);
    }
    EXPECT_LT(model.mean_reprojection_error_px, 1e-6);
  }

  const TempDir dir_;
  const FrameOptions frame_{.frame = GetParam(),
                            .points_apart = GetParam() == std::string("sfm") ? "1,2,3,4,5,6=0.30" : ""};
  const ExportedScene scene_ = tests::SphereExport(dir_ / "scene", frame_);
  const fs::path out_ = dir_ / "out";
};

TEST_P(CamerasExport, TransformsComeBackInBothDialects) {
  const io::TransformsFile all = io::ReadTransforms(out_ / "transforms.json");
  EXPECT_EQ(all.dialect, io::TransformsDialect::kNerfstudio);
  ExpectPoses(all.scene, 20, 1e-9);
  ASSERT_EQ(all.scene.points.size(), 30u);
  EXPECT_EQ(all.scene.points[4].frame_indices, (std::vector<int>{1, 7}));
  for (const int k : {1, 7})
    EXPECT_EQ(&FrameOf(all.scene.frames[static_cast<std::size_t>(k)].image_path),
              &scene_.train.frames[static_cast<std::size_t>(k)]);
  // near, far and the box hold in scene coordinates alone.
  EXPECT_EQ(all.has_near_far, scene_.target.IsScene());
  const auto train = io::ReadTransforms(out_ / "transforms_train.json"),
             test = io::ReadTransforms(out_ / "transforms_test.json");
  EXPECT_EQ(train.dialect, io::TransformsDialect::kBlender);
  ExpectPoses(train.scene, 16, 1e-9);
  ExpectPoses(test.scene, 4, 1e-9);
  EXPECT_EQ(ReadText(out_ / "images/view_4.png"), ReadText(scene_.test.frames[0].image_path));
}

TEST_P(CamerasExport, ColmapModelsComeBack) {
  ExpectModel(io::ReadColmapModel(out_ / "colmap_text"), 1e-9);
  ExpectModel(io::ReadColmapModel(out_ / "colmap_bin"), 1e-9);
  EXPECT_EQ(io::ReadColmapModel(out_ / "colmap_bin").scene.frames[4].image_path, "view_4.png");
}

TEST_P(CamerasExport, ColmapReadsBothOfItsForms) {
  REQUIRE_PROGRAM("colmap");
  for (const char* form : {"colmap_text", "colmap_bin"}) {
    for (const std::string type : {"TXT", "BIN"}) {
      const fs::path converted = dir_ / (form + type);
      fs::create_directories(converted);
      const io::ProcessReport report = io::RunProcess({io::FindProgram("colmap")->string(),
                                                       "model_converter",
                                                       "--input_path",
                                                       (out_ / form).string(),
                                                       "--output_path",
                                                       converted.string(),
                                                       "--output_type",
                                                       type},
                                                      {.log_path = dir_ / "log"});
      ASSERT_EQ(report.exit_code, 0) << ReadText(dir_ / "log");
      ExpectModel(io::ReadColmapModel(converted), 1e-9);
    }
  }
}

TEST_P(CamerasExport, AnEarlierExportIsReplaced) {
  WriteText(out_ / "left over", "x");
  ExportCameras(scene_, out_);
  EXPECT_FALSE(fs::exists(out_ / "left over"));
  EXPECT_EQ(std::distance(fs::directory_iterator(dir_.path()), {}), 2);
}

INSTANTIATE_TEST_SUITE_P(Frames, CamerasExport, testing::Values("scene", "sfm"));

}  // namespace
}  // namespace pipeline
