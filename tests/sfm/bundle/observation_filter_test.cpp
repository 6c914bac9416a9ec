// What is removed from an adjusted model, and the figures of the rest.
#include "sfm/bundle/observation_filter.h"

#include <gtest/gtest.h>

#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

using Eigen::Vector3d;

TEST(ObservationFilter, RemovesWhatDoesNotAgreeAndRecomputesTheRest) {
  io::ColmapModel model = RingModel(8, 60, SmallCamera(), 0.2, 13);
  const std::size_t n_points = model.scene.points.size(), n_observations = model.observations.size();
  std::vector<io::Observation*> of_point[3];
  for (io::Observation& o : model.observations) {
    if (o.point_index < 3) of_point[o.point_index].push_back(&o);
  }
  of_point[0][0]->xy.x() += 5.5;                                                     // one mismatch
  for (std::size_t i = 1; i < of_point[1].size(); ++i) of_point[1][i]->xy.y() += 6;  // one left: point goes
  io::Point3D& far = model.scene.points[2];  // rays that hardly diverge
  far.xyz = model.scene.frames[0].world_from_cam * Vector3d(0, 0, -1e4);
  for (io::Observation* o : of_point[2]) {
    o->xy = io::Project(model.scene, *o).value_or(Eigen::Vector2d(0, 0));
  }
  const std::size_t of_removed = of_point[1].size() + of_point[2].size();
  const auto report = sfm::RemoveWeakObservations(&model);
  EXPECT_EQ(report.removed_points, 2);
  EXPECT_EQ(report.removed_observations, static_cast<int>(of_removed + 1));
  EXPECT_EQ(model.scene.points.size(), n_points - 2);
  EXPECT_EQ(model.observations.size(), n_observations - of_removed - 1);
  EXPECT_NEAR(report.rms_px, 0.2 * std::sqrt(2), 0.02);

  // The model reads back as it is: errors, tracks and indices are what the reader computes.
  const TempDir folder;
  io::WriteColmapModel(folder.path(), model);
  const io::ColmapModel read = io::ReadColmapModel(folder.path());
  EXPECT_EQ(read.observations, model.observations);
  EXPECT_NEAR(read.mean_reprojection_error_px, model.mean_reprojection_error_px, 1e-9);
  EXPECT_EQ(read.mean_track_length, model.mean_track_length);
  double error_sum = 0;
  for (const io::Point3D& p : model.scene.points)
    error_sum += p.error_px * static_cast<double>(p.frame_indices.size());
  EXPECT_NEAR(
      error_sum / static_cast<double>(model.observations.size()), model.mean_reprojection_error_px, 1e-12);
}

}  // namespace
