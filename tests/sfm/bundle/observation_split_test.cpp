// Which observations a camera model is chosen with, and which it is tested on.
#include "sfm/bundle/observation_split.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

// How many of each point's observations are used for training, and how many are held out.
std::vector<std::pair<int, int>> Counts(const sfm::ObservationSplit& split) {
  std::vector<std::pair<int, int>> counts(split.training.scene.points.size());
  for (const io::Observation& o : split.training.observations)
    ++counts.at(static_cast<std::size_t>(o.point_index)).first;
  for (const io::Observation& o : split.held_out) ++counts.at(static_cast<std::size_t>(o.point_index)).second;
  return counts;
}

TEST(ObservationSplit, ATenthIsHeldOutAndNothingIsUsedTwice) {
  const io::ColmapModel model = RingModel(14, 150, SmallCamera(), 0, 1);
  const sfm::ObservationSplit split = sfm::SplitObservations(model, 1);
  const std::size_t held_out = split.held_out.size(), all = model.observations.size();
  EXPECT_EQ(split.training.scene.frames.size(), 14u);
  EXPECT_EQ(split.training.observations.size() + held_out, all);
  EXPECT_NEAR(static_cast<double>(held_out) / static_cast<double>(all), 0.1, 0.02);
  for (const auto& [training, tested] : Counts(split)) EXPECT_LE(tested, 6);  // of 14: not whole points
  // Without noise, every observation is where its point projects to.
  EXPECT_LT(sfm::HeldOutPx(split.training.scene, split.training.observations), 1e-9);
  EXPECT_LT(sfm::HeldOutPx(split.training.scene, split.held_out), 1e-9);

  EXPECT_EQ(sfm::SplitObservations(model, 1).held_out, split.held_out);
  EXPECT_NE(sfm::SplitObservations(model, 2).held_out, split.held_out);
}

TEST(ObservationSplit, ThreeObservationsOfAPointRemain) {
  int reduced = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const io::ColmapModel model = RingModel(5, 60, SmallCamera(), 0, seed);
    for (const auto& [training, tested] : Counts(sfm::SplitObservations(model, seed))) {
      EXPECT_GE(training, 3);
      reduced += training == 3 && tested > 0;
    }
  }
  EXPECT_GT(reduced, 0);
}

// `n` points, each observed at this place of the first `track` frames. x is the number of the point.
void AddPoints(io::ColmapModel* model, int n, int track, double x, double y) {
  for (int i = 0; i < n; ++i) {
    const int index = static_cast<int>(model->scene.points.size());
    model->scene.points.push_back({.xyz = {static_cast<double>(index), 0, 0}});
    for (int frame = 0; frame < track; ++frame) model->observations.push_back({frame, index, {x, y}});
  }
}

TEST(ObservationSplit, LongTracksComeFirstButCornersAreSeen) {
  io::ColmapModel model;
  model.scene.cameras = {SmallCamera()};
  model.scene.frames.resize(5);
  AddPoints(&model, 1000, 4, 320, 240);
  AddPoints(&model, 6, 3, 630, 10);  // two corners
  AddPoints(&model, 6, 3, 10, 470);
  AddPoints(&model, 1400, 5, 320, 240);
  const sfm::ObservationSplit split = sfm::SplitObservations(model, 0);
  const auto& points = split.training.scene.points;
  ASSERT_EQ(points.size(), 1500u);
  const auto by_number = [](const io::Point3D& a, const io::Point3D& b) { return a.xyz.x() < b.xyz.x(); };
  EXPECT_TRUE(std::is_sorted(points.begin(), points.end(), by_number));
  const auto counts = Counts(split);
  std::map<int, int> kinds;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const int i = static_cast<int>(points[k].xyz.x());
    ++kinds[i < 1000 ? 0 : i < 1006 ? 1 : i < 1012 ? 2 : 3];
    EXPECT_EQ(counts[k].first + counts[k].second, i < 1000 ? 4 : i < 1012 ? 3 : 5) << i;
  }
  EXPECT_EQ(kinds[1], 4);
  EXPECT_EQ(kinds[2], 4);
  EXPECT_EQ(kinds[3], 1400);
}

TEST(ObservationSplit, HeldOutErrorIsTheRootOfTheMeanLoss) {
  io::Scene scene;
  scene.cameras = {SmallCamera()};
  scene.frames.resize(1);
  scene.points = {{.xyz = {0, 0, -2}}, {.xyz = {0, 0, 2}}};  // the second lies behind the camera
  EXPECT_EQ(sfm::HeldOutPx(scene, {}), 0);
  const std::vector<io::Observation> observations = {
      {0, 0, {320, 243}},
      {.point_index = 0, .xy = {322, 240}, .sigma = 2},
      {.point_index = 1, .xy = {0, 0}},
  };
  EXPECT_NEAR(
      sfm::HeldOutPx(scene, observations), std::sqrt((std::log(1 + 9.0) + std::log(1 + 1.0)) / 2), 1e-12);
}

}  // namespace
