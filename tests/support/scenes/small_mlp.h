// The `nerf` field on the ball of tests/support/scenes/ball_scene.h, as cheap as it gets: the network has its
// full size, so rays and samples are few.
#pragma once

#include <cmath>
#include <filesystem>

#include "io/image/image.h"
#include "nerf/fields/checkpoint.h"
#include "nerf/training/trainer.h"
#include "tests/support/programs/torch_environment.h"
#include "tests/support/scenes/ball_scene.h"

namespace tests {

// far gives `nerf` intervals of (far - near) / 192 where the occupancy grid says what to sample; with a fixed
// number of samples per ray they lie between near and far.
inline io::Scene SmallBall(const std::filesystem::path& folder, int n_views, double phase, double far) {
  std::filesystem::create_directories(folder);
  io::Scene scene = BallScene(folder, n_views, phase, {.size = 24});
  scene.near = 3;
  scene.far = far;
  return scene;
}
inline constexpr double kPrunedFar = 15, kStratifiedFar = 5;

inline nerf::TrainOptions SmallMlp(int steps, int rays, const nerf::QuadratureOptions& quadrature = {}) {
  nerf::TrainOptions options;
  options.steps = steps;
  options.threads = 2;
  options.learning_rate = 1e-3;
  options.field.kind = nerf::FieldKind::kMlp;
  options.field.grid_resolution = 64;
  options.field.mlp.quadrature = quadrature;
  options.mlp.rays = rays;
  options.mlp.samples_per_step = 1024;
  options.mlp.learning_rate_warm_up = 0;
  options.mlp.learning_rate_final = 1;  // a rate that does not depend on `steps`, so that runs can be cut
  return options;
}

inline nerf::MlpField& FieldOf(nerf::SceneField* scene_field) {
  return dynamic_cast<nerf::MlpField&>(*scene_field->field);
}

// Mean squared error on white of a picture [n][3] against the view that was written for a frame.
inline double SquaredError(const io::Frame& frame, const std::vector<float>& rgb) {
  const io::Image truth = io::ReadImage(frame.image_path);
  double sum = 0;
  for (std::size_t i = 0; i < rgb.size(); ++i) {
    const std::uint8_t* p = &truth.data[i / 3 * 4];
    const double alpha = p[3] / 255., want = alpha * p[i % 3] / 255. + 1 - alpha;
    sum += (rgb[i] - want) * (rgb[i] - want);
  }
  return sum / static_cast<double>(rgb.size());
}

}  // namespace tests
