// Support for tests: splats of a file, read without any code of ours, in the layout of the reference
// implementation of 3D Gaussian Splatting.
#pragma once

#include "nerf/splatting/splats.h"
#include "tests/support/files/sphere_export.h"

namespace tests {

inline nerf::Splats SplatsOfFile(const std::filesystem::path& file) {
  const auto columns = PlyColumns(file);
  const auto at = [&](const std::string& name, std::size_t i) {
    return static_cast<float>(columns.at(name)[i]);
  };
  nerf::Splats splats;
  splats.resize(columns.at("x").size());
  for (std::size_t i = 0; i < splats.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      splats.places[3 * i + c] = at(std::string(1, "xyz"[c]), i);
      splats.log_scales[3 * i + c] = at("scale_" + std::to_string(c), i);
      float* colours = &splats.colours[i * nerf::kHarmonics * 3 + c];
      colours[0] = at("f_dc_" + std::to_string(c), i);
      for (std::size_t k = 0; k < 3; ++k) colours[3 * (k + 1)] = at("f_rest_" + std::to_string(3 * c + k), i);
    }
    for (std::size_t k = 0; k < 4; ++k) splats.rotations[4 * i + k] = at("rot_" + std::to_string(k), i);
    splats.opacities[i] = at("opacity", i);
  }
  return splats;
}

}  // namespace tests
