#include "nerf/splatting/plain_rasteriser.h"

#include <algorithm>
#include <cmath>

#include "nerf/kernels/splat_blending_reference.h"
#include "nerf/kernels/splat_projection_reference.h"

namespace nerf {
namespace {

using Seen = kernels::reference::ProjectedSplat;

Seen Project(const Splats& splats, std::size_t i, const kernels::SplatCamera& camera) {
  const auto row = [i](const std::vector<float>& values, std::size_t width) {
    const float* begin = &values[width * i];
    return std::vector<double>(begin, begin + width);
  };
  const std::vector<double> place = row(splats.places, 3), log_scales = row(splats.log_scales, 3),
                            rotation = row(splats.rotations, 4), opacity = row(splats.opacities, 1),
                            colours = row(splats.colours, 3 * kHarmonics);
  return kernels::reference::ProjectSplat(
      camera, {place.data(), log_scales.data(), rotation.data(), opacity.data(), colours.data()});
}

// The pixels [begin, end) of n whose centres may lie within `reach` of `middle`.
std::pair<int, int> Reached(double middle, double reach, int n) {
  const auto pixel = [n](double place) { return static_cast<int>(std::clamp(place, 0.0, 1.0 * n)); };
  return {pixel(std::floor(middle - reach)), pixel(std::ceil(middle + reach))};
}

}  // namespace

std::vector<double> RenderPlainly(const Splats& splats,
                                  const SplatView& view,
                                  const std::array<double, 3>& background) {
  const io::Camera& camera = view.camera;
  const kernels::SplatCamera splat_camera = CameraOf(view);
  std::vector<Seen> order;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const Seen seen = Project(splats, i, splat_camera);
    if (seen.depth > kNearestSplat) order.push_back(seen);
  }
  std::stable_sort(
      order.begin(), order.end(), [](const Seen& a, const Seen& b) { return a.depth < b.depth; });
  const auto n = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  std::vector<double> rgb(3 * n), transmittance(n, 1);
  for (const Seen& seen : order) {
    const auto [x_begin, x_end] = Reached(seen.blended.x, seen.blended.reach_x, camera.width);
    const auto [y_begin, y_end] = Reached(seen.blended.y, seen.blended.reach_y, camera.height);
    for (int y = y_begin; y < y_end; ++y) {
      for (int x = x_begin; x < x_end; ++x) {
        const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) +
                           static_cast<std::size_t>(x);
        kernels::reference::BlendSplat(seen.blended, x, y, &rgb[3 * pixel], &transmittance[pixel]);
      }
    }
  }
  for (std::size_t i = 0; i < 3 * n; ++i) rgb[i] += transmittance[i / 3] * background[i % 3];
  return rgb;
}

}  // namespace nerf
