// COLMAP models that the test writes itself: round trips in both forms.
#include "io/scene/colmap_model.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/support/files/small_colmap_model.h"
#include "tests/support/scenes/scene_matchers.h"

namespace {

namespace fs = std::filesystem;

void ExpectSmallModel(const io::ColmapModel& model) {
  const io::Scene& scene = model.scene;
  ASSERT_EQ(scene.cameras.size(), 2u);
  EXPECT_EQ(scene.cameras[0], (io::Camera{640, 480, 500, 500, 320, 240, 0.1, 0, 0, 0}));
  EXPECT_EQ(scene.cameras[1], (io::Camera{320, 240, 300, 310, 160, 120, 0.05, -0.01, 1e-3, -2e-3}));
  ASSERT_EQ(scene.frames.size(), 3u);
  EXPECT_EQ(scene.frames[0].image_path, "view 2.png");  // natural order
  // cam_from_world = (I, (0, 0, 1)): the centre is at z = -1, and the camera looks along +z of the world.
  const io::Rigid3d expected{Eigen::Vector3d(1, -1, -1).asDiagonal(), {0, 0, -1}};
  EXPECT_THAT(scene.frames[2].world_from_cam, tests::PoseNear(expected, 1e-15));
  ASSERT_EQ(scene.points.size(), 4u);
  EXPECT_EQ(scene.points[2].rgb, (std::array<std::uint8_t, 3>{2, 128, 255}));
  EXPECT_EQ(scene.points[2].frame_indices, (std::vector<int>{1, 0}));
  EXPECT_EQ(model.camera_model, "SIMPLE_RADIAL");
  ASSERT_EQ(model.observations.size(), 8u);  // point by point, in the order of the tracks
  for (std::size_t i = 0; i < 8; ++i) {
    const io::Observation& observation = model.observations[i];
    EXPECT_EQ(observation.point_index, static_cast<int>(i / 2));
    EXPECT_EQ(observation.frame_index, scene.points[i / 2].frame_indices[i % 2]);
    const io::Frame& frame = scene.frames[static_cast<std::size_t>(observation.frame_index)];
    const Eigen::Vector2d projected =
        *io::ImgFromCam(scene.cameras[static_cast<std::size_t>(frame.camera_index)],
                        frame.world_from_cam.Inverse() * scene.points[i / 2].xyz);
    EXPECT_NEAR((observation.xy - projected - Eigen::Vector2d(1, 0)).norm(), 0, 1e-9);
  }
  EXPECT_EQ(model.mean_track_length, 2);
  EXPECT_NEAR(model.mean_reprojection_error_px, 1, 1e-9);  // pins axes, pose and distortion conventions
}

TEST(ColmapModel, BinaryRoundTripBesideTheRigsOfNewerVersions) {
  const TempDir folder;
  EXPECT_FALSE(io::IsColmapModel(folder.path()));
  WriteBinary(SmallModel(), folder.path());
  EXPECT_TRUE(io::IsColmapModel(folder.path()));
  WriteText(folder.path() / "rigs.bin", "x");
  WriteText(folder.path() / "frames.bin", "x");
  ExpectSmallModel(io::ReadColmapModel(folder.path()));
}

TEST(ColmapModel, TextRoundTripKeepsNamesWithBlanksAndEmptyFeatureLines) {
  const TempDir folder;
  WriteText(SmallModel(), folder.path());
  ExpectSmallModel(io::ReadColmapModel(folder.path()));
}

class WrittenColmapModel : public testing::TestWithParam<io::ColmapForm> {};

TEST_P(WrittenColmapModel, IsReadBackExactly) {
  // One camera for each model that the writer knows, then everything a model holds.
  const io::Camera pinhole{.width = 64, .height = 48, .fl_x = 50.1, .fl_y = 50.1, .cx = 32, .cy = 24.3};
  std::vector<std::pair<std::string, io::Camera>> cases(6, {"SIMPLE_PINHOLE", pinhole});
  cases[1].first = "PINHOLE", cases[1].second.fl_y = 50.2;
  cases[2].first = "SIMPLE_RADIAL", cases[2].second.k1 = 0.1;
  cases[3].first = "RADIAL", cases[3].second.k2 = -1.0 / 3;
  cases[4].first = "OPENCV", cases[4].second.p2 = 1e-300;
  cases[5].first = "OPENCV", cases[5].second.fl_y = 49, cases[5].second.k1 = 0.1;
  for (const auto& [name, camera] : cases) {
    const TempDir folder;
    io::ColmapModel model;
    model.scene.cameras = {camera};
    io::WriteColmapModel(folder.path(), model, GetParam());
    const io::ColmapModel read = io::ReadColmapModel(folder.path());
    EXPECT_EQ(read.camera_model, name);
    EXPECT_EQ(read.scene.cameras, model.scene.cameras);
  }
  EXPECT_EQ(cases.size(), 6u);

  const TempDir first, second;
  WriteBinary(SmallModel(), first.path());
  const io::ColmapModel model = io::ReadColmapModel(first.path());
  io::WriteColmapModel(second.path(), model, GetParam());
  const bool is_binary = GetParam() == io::ColmapForm::kBinary;
  EXPECT_EQ(fs::exists(second / "points3D.bin"), is_binary);
  EXPECT_EQ(fs::exists(second / "points3D.txt"), !is_binary);
  const io::ColmapModel read = io::ReadColmapModel(second.path());
  ExpectSmallModel(read);
  EXPECT_EQ(read.observations, model.observations);
  EXPECT_EQ(read.scene.cameras, model.scene.cameras);
  for (std::size_t i = 0; i < 3; ++i) {
    const io::Frame &a = model.scene.frames[i], &b = read.scene.frames[i];
    EXPECT_EQ(a.image_path, b.image_path);
    EXPECT_EQ(a.camera_index, b.camera_index);
    // Matrix to quaternion and back: a few roundings of numbers up to 5.
    EXPECT_THAT(b.world_from_cam, tests::PoseNear(a.world_from_cam, 2e-15, 1e-14));
  }
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(model.scene.points[i].xyz, read.scene.points[i].xyz);
    EXPECT_EQ(model.scene.points[i].error_px, read.scene.points[i].error_px);
    EXPECT_EQ(model.scene.points[i].frame_indices, read.scene.points[i].frame_indices);
  }
}

INSTANTIATE_TEST_SUITE_P(Forms,
                         WrittenColmapModel,
                         testing::Values(io::ColmapForm::kText, io::ColmapForm::kBinary));

TEST(ColmapModel, ReadsTheBookModel) {
  const char* data = std::getenv("PIPELINE_DATA");
  const fs::path folder =
      fs::path(data ? data : SOURCE_DIR "/../shared/data") / "book_colmap" / "sparse" / "0";
  if (!io::IsColmapModel(folder)) GTEST_SKIP() << folder << " is absent";
  const io::ColmapModel model = io::ReadColmapModel(folder);
  EXPECT_EQ(model.scene.frames.size(), 7u);
  EXPECT_GT(model.scene.points.size(), 500u);
  EXPECT_LT(model.mean_reprojection_error_px, 1.5);
}

}  // namespace
