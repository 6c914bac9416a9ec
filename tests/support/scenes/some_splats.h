// Support for tests: a small scene of splats, and a view of it.
#pragma once

#include <cmath>

#include "io/base/random.h"
#include "nerf/splatting/splats.h"

namespace tests {

// n splats of all shapes and colours in [-1, 1]^3.
inline nerf::Splats SomeSplats(std::size_t n) {
  nerf::Splats splats;
  splats.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    io::Random random(3, io::Stream::kSplat, 0, i);
    const auto draw = [&](float low, float high) { return low + (high - low) * random.Uniform(); };
    for (std::size_t c = 0; c < 3; ++c) {
      splats.places[3 * i + c] = draw(-1, 1);
      splats.log_scales[3 * i + c] = draw(std::log(0.02f), std::log(0.2f));
    }
    for (std::size_t k = 0; k < 4; ++k) splats.rotations[4 * i + k] = draw(-1, 1);
    splats.opacities[i] = draw(-2, 2);
    for (std::size_t k = 0; k < 3 * nerf::kHarmonics; ++k)
      splats.colours[3 * nerf::kHarmonics * i + k] = draw(-0.6f, 0.6f);
  }
  return splats;
}

// From outside, slantwise, of width x height pixels.
inline nerf::SplatView SomeView(int width, int height) {
  nerf::SplatView view;
  view.camera = {.width = width,
                 .height = height,
                 .fl_x = 1.1 * width,
                 .fl_y = 1.0 * width,
                 .cx = 0.52 * width,
                 .cy = 0.47 * height};
  view.world_from_cam.rotation =
      (Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  view.world_from_cam.translation = 3 * view.world_from_cam.rotation.col(2);
  return view;
}

}  // namespace tests
