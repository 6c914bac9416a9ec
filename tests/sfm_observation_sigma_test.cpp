// Large features count less.
#include "sfm/observation_sigma.h"

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
  for (int i = 0; i < 5; ++i) {
    model.observations.push_back(
        {.xy = {static_cast<double>(features.keypoints[i].x), static_cast<double>(7.7f)}});
  }
  model.observations.push_back({.xy = {3, 3}, .sigma = 1});  // nobody's position
  sfm::SetSigmas({"a.png", "b.png"}, {{}, features}, &model);
  // Scales 0.5 (counted as 1), 1, 2, 4, 8; the median is 2.
  const double expected[] = {0.5, 0.5, 1, 2, 4};
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(model.observations[i].sigma, std::pow(expected[i], 0.7), 1e-6) << i;
  }
  EXPECT_EQ(model.observations[5].sigma, 1);
}

}  // namespace
