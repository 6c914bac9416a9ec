// A capture mapped in blocks has the poses that it has when it is mapped as a whole.
#include "sfm/adjust_joined.h"

#include <gtest/gtest.h>

#include "sfm/mapping/mapping_attempt.h"
#include "sfm/scene/pose_error.h"
#include "sfm/synthetic/synthetic_capture.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/require_program.h"
#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

// Two turns around a ball; each picture matches the five that follow it.
sfm::SyntheticCapture Spiral() {
  return sfm::MakeSyntheticCapture({.trajectory = sfm::Trajectory::kSpiral,
                                    .pictures = 30,
                                    .points = 200,
                                    .noise_px = 0.3,
                                    .graph = sfm::MatchGraph::kChain,
                                    .chain_overlap = 5,
                                    .seed = 2});
}

sfm::MappingAttempt MapInBlocks(const sfm::SyntheticCapture& capture,
                                const std::filesystem::path& folder,
                                int threads) {
  const auto views = std::make_shared<sfm::CapturedViews>(sfm::CapturedViews{
      sfm::Names(capture.pictures), sfm::CameraGroups(capture.pictures), capture.features});
  return sfm::Attempt(
      capture.pictures,
      views,
      capture.matches,
      "",
      folder,
      {.adjust_joined = sfm::AdjustJoined, .blocks = {.pictures = 14, .overlap = 0.6}, .threads = threads});
}

TEST(AdjustJoined, PartsThatLieApartAreBroughtTogether) {
  const io::ColmapModel truth = RingModel(14, 300, SmallCamera(), 0.3, 5);
  io::ColmapModel model = truth;
  model.camera_model = "SIMPLE_PINHOLE";
  for (std::size_t i = 7; i < 14; ++i) model.scene.frames[i].world_from_cam.translation.x() += 0.02;
  const double before = sfm::ComparePoses(model.scene, truth.scene).centre_rmse;
  sfm::AdjustJoined(&model);
  EXPECT_LT(sfm::ComparePoses(model.scene, truth.scene).centre_rmse, before / 5);
}

TEST(JoinedBlocks, HaveTheTruePosesForAnyNumberOfThreads) {
  REQUIRE_PROGRAM("colmap");
  const TempDir dir;
  const sfm::SyntheticCapture capture = Spiral();
  const sfm::MappingAttempt attempt = MapInBlocks(capture, dir / "two", 2);
  EXPECT_GE(attempt.n_blocks, 3u);
  EXPECT_EQ(attempt.n_joined, attempt.n_blocks);
  ASSERT_EQ(attempt.Registered(), 30);
  const io::Scene& scene = attempt.models.front().scene;
  const sfm::PoseError error = sfm::ComparePoses(scene, capture.truth);
  EXPECT_LT(error.rotation_max_deg, 0.1);
  EXPECT_LT(error.centre_max, 2e-3);
  EXPECT_GT(attempt.models.front().mean_track_length, 29) << "tracks go on beyond the border of a block";

  const io::Scene other = MapInBlocks(capture, dir / "one", 1).models.front().scene;
  ASSERT_EQ(other.frames.size(), 30u);
  for (std::size_t i = 0; i < 30; ++i) {
    EXPECT_EQ(scene.frames[i].world_from_cam.rotation, other.frames[i].world_from_cam.rotation) << i;
    EXPECT_EQ(scene.frames[i].world_from_cam.translation, other.frames[i].world_from_cam.translation) << i;
  }
}

}  // namespace
