#include "nerf/surface/depth_view.h"

#include <algorithm>
#include <cmath>

#include "io/image/mask.h"
#include "nerf/rendering/support_map.h"

namespace nerf {
namespace {

using Eigen::Vector3f;

// Of the rendering. A field shows its surfaces where training with its own intervals needs them: with coarser
// intervals they lie behind their true place, with finer ones before it (nerf/EXPERIMENTS.md).
constexpr float kStepScale = 0.45f;

// Where a pixel's ray meets the plane at distance 1 before the camera.
struct Rays {
  explicit Rays(const io::Camera& camera)
      : inv_fl_x(1 / static_cast<float>(camera.fl_x)),
        inv_fl_y(1 / static_cast<float>(camera.fl_y)),
        cx(static_cast<float>(camera.cx)),
        cy(static_cast<float>(camera.cy)) {}
  Vector3f At(int x, int y) const {
    return {
        (static_cast<float>(x) + 0.5f - cx) * inv_fl_x, -(static_cast<float>(y) + 0.5f - cy) * inv_fl_y, -1};
  }
  float inv_fl_x, inv_fl_y, cx, cy;
};

// The step from a pixel to the next one along a row or column, on the surface that it shows: between both
// neighbours, or to the one that shows the same surface. Zero when neither does.
Vector3f StepOnSurface(const Vector3f& before, const Vector3f& here, const Vector3f& after, float jump) {
  const bool joins_before = std::abs(before.z() - here.z()) <= jump,
             joins_after = std::abs(after.z() - here.z()) <= jump;
  if (joins_before && joins_after) return 0.5f * (after - before);
  if (joins_before) return here - before;
  if (joins_after) return after - here;
  return Vector3f::Zero();
}

}  // namespace

std::vector<DepthView> RenderDepthViews(const TrainedField& field,
                                        const io::Scene& train,
                                        int threads,
                                        const std::function<void(double share)>& progress) {
  std::vector<DepthView> views;
  for (const io::Frame& frame : train.frames) {
    const io::Camera& full = train.cameras[static_cast<std::size_t>(frame.camera_index)];
    DepthView view{.camera = SmallCamera(full, kMaxViewSide),
                   .world_from_cam = frame.world_from_cam,
                   .cam_from_world = frame.world_from_cam.Inverse(),
                   .depth = {},
                   .rgb = {}};
    const RenderedView rendered =
        field.Render(view.camera,
                     frame.world_from_cam,
                     {.threads = threads, .step_scale = kStepScale, .samples_per_pixel = 1});
    io::Mask mask;
    if (!frame.mask_path.empty()) {
      mask = io::ShrinkMask(
          io::ReadMask(frame.mask_path, full.width, full.height), view.camera.width, view.camera.height);
    }
    view.depth.resize(rendered.depth.size());
    const Rays rays(view.camera);
    for (std::size_t i = 0; i < view.depth.size(); ++i) {
      const int x = static_cast<int>(i) % view.camera.width, y = static_cast<int>(i) / view.camera.width;
      const float opacity = rendered.opacity[i];
      const bool is_solid = opacity >= kLeastSolidOpacity, is_empty = opacity <= kMostEmptyOpacity;
      view.depth[i] = !mask.Uses(i) || !(is_solid || is_empty) ? DepthView::kUnused
                      : is_empty                               ? std::numeric_limits<float>::infinity()
                                 : rendered.median_depth[i] / rays.At(x, y).norm();
    }
    for (const float c : rendered.rgb) view.rgb.push_back(static_cast<std::uint8_t>(std::lround(255 * c)));
    views.push_back(std::move(view));
    progress(static_cast<double>(views.size()) / static_cast<double>(train.frames.size()));
  }
  return views;
}

std::vector<Facet> FacetsOf(const DepthView& view, io::Workers* workers) {
  const int width = view.camera.width, height = view.camera.height;
  const Rays rays(view.camera);
  const float pixel_angle = 1 / static_cast<float>(std::sqrt(view.camera.fl_x * view.camera.fl_y));
  // Pixels without a surface, and those outside of the picture, are too far from all others to join.
  const auto point = [&](int x, int y) -> Vector3f {
    const bool is_outside = x < 0 || y < 0 || x >= width || y >= height;
    const float depth = is_outside ? -1 : view.depth[static_cast<std::size_t>(y * width + x)];
    if (!(depth > 0 && std::isfinite(depth))) return {0, 0, std::numeric_limits<float>::infinity()};
    return depth * rays.At(x, y);
  };
  // Beside something, half a pixel decides whether a ray meets it, and its edges would be carved away.
  const auto is_empty = [&](int x, int y) {
    for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(width - 1, x + 1); ++u) {
        if (!std::isinf(view.depth[static_cast<std::size_t>(v * width + u)])) return false;
      }
    }
    return true;
  };
  std::vector<Facet> facets(view.depth.size());
  workers->Run(height, [&](int y, int) {
    for (int x = 0; x < width; ++x) {
      const auto i = static_cast<std::size_t>(y * width + x);
      Facet& facet = facets[i];
      facet = {Vector3f::Zero(), Vector3f::UnitZ(), 0, is_empty(x, y)};
      if (!(view.depth[i] > 0 && std::isfinite(view.depth[i]))) continue;
      facet.point = point(x, y);
      const float jump = kJumpFootprints * pixel_angle * view.depth[i];
      const Vector3f right = StepOnSurface(point(x - 1, y), facet.point, point(x + 1, y), jump),
                     down = StepOnSurface(point(x, y - 1), facet.point, point(x, y + 1), jump);
      const Vector3f normal = down.cross(right);
      if (!(normal.squaredNorm() > 0)) continue;
      facet.normal = normal.normalized();
      const float cosine = -facet.normal.dot(facet.point.normalized());
      if (cosine > 0) facet.weight = cosine * cosine / (view.depth[i] * view.depth[i]);
    }
  });
  return facets;
}

}  // namespace nerf
