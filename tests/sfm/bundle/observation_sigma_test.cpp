// Large features count less.
#include "sfm/bundle/observation_sigma.h"

#include <gtest/gtest.h>

#include <cmath>

namespace {

TEST(ObservationSigma, GrowsWithTheScaleOfTheKeypointThere) {
  sfm::Features features;
  for (int i = 0; i < 5; ++i) {
    features.keypoints.push_back({.x = static_cast<float>(10 * i) + 0.3f,
                                  .y = 7.7f,
                                  .scale = std::pow(2.0f, static_cast<float>(i) - 1)});
  }
  io::ColmapModel model;
  model.scene.frames.resize(1);
  model.scene.frames[0].image_path = "b.png";
  for (std::size_t i = 0; i < 5; ++i) {
    model.observations.push_back(
        {.xy = {static_cast<double>(features.keypoints[i].x), static_cast<double>(7.7f)}});
  }
  model.observations.push_back({.xy = {3, 3}, .sigma = 1});  // nobody's position
  sfm::SetSigmas({"a.png", "b.png"}, {{}, features}, &model);
  // Scales 0.5 (counted as 1), 1, 2, 4, 8; the median is 2.
  const double expected[] = {0.5, 0.5, 1, 2, 4};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(model.observations[i].sigma, std::pow(expected[i], 0.7), 1e-6) << i;
  }
  EXPECT_EQ(model.observations[5].sigma, 1);
}

TEST(ObservationSigma, EachFrameHasItsOwnKeypoints) {
  io::ColmapModel model;
  model.scene.frames.resize(2);
  model.scene.frames[0].image_path = "b.png";
  model.scene.frames[1].image_path = "a.png";
  model.observations = {{.frame_index = 0, .xy = {3, 5}}, {.frame_index = 1, .xy = {3, 5}}};
  std::vector<sfm::Features> features(2);
  features[0].keypoints = {{.x = 3, .y = 5, .scale = 8}};
  features[1].keypoints = {{.x = 3, .y = 5, .scale = 2}};
  sfm::SetSigmas({"a.png", "b.png"}, features, &model);
  EXPECT_NEAR(model.observations[0].sigma / model.observations[1].sigma, std::pow(0.25, 0.7), 1e-6);
}

}  // namespace
