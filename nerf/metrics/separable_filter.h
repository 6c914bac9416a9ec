// Separable correlation of single-channel pictures in double, shared by SSIM and FLIP.
#pragma once

#include <cstddef>
#include <vector>

namespace nerf {

// One channel, rows top to bottom.
struct Plane {
  Plane(int plane_width, int plane_height)
      : width(plane_width),
        height(plane_height),
        values(static_cast<std::size_t>(std::ptrdiff_t{width} * height)) {}
  const double* Row(int y) const { return &values[static_cast<std::size_t>(std::ptrdiff_t{y} * width)]; }
  double* Row(int y) { return &values[static_cast<std::size_t>(std::ptrdiff_t{y} * width)]; }

  int width, height;
  std::vector<double> values;  // [height][width]
};

// kValid: only pixels whose whole window lies in the picture, so the result is 2r smaller in each direction.
// kReplicate: the result has the picture's size; outside it the nearest border pixel stands.
enum class Border { kValid, kReplicate };

// out(x, y) = sum_ij kernel_x[i] kernel_y[j] in(x + i - r, y + j - r) over windows of 2r + 1 taps. Both
// kernels have the same odd length.
Plane Correlate(const Plane& in,
                const std::vector<double>& kernel_x,
                const std::vector<double>& kernel_y,
                Border border);

}  // namespace nerf
