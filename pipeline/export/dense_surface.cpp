#include "pipeline/export/dense_surface.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "io/base/error.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "pipeline/export/view_surface.h"

namespace pipeline {
namespace {

// A view alone may show what is not there.
constexpr int kMinSupport = 2;
// Cosine of the steepest slant, 80 degrees, at which a view's depth is taken: beyond it, a pixel covers many
// times its footprint. Another view sees such a surface better.
constexpr double kMinCosine = 0.17;
// A pixel counts by the share of its neighbours on the same surface to this power: on a straight edge, where
// its colour is of both sides, a sixteenth; thin things, which are all edge, keep their colour.
constexpr double kEdgePower = 4;
// Side of the first cells as a share of the median footprint of a pixel: nothing that a view tells apart is
// merged before there are too many points.
constexpr double kFirstCell = 0.25;

io::Camera CameraFor(const io::Camera& camera, int size) {
  return size == 0 ? camera : nerf::SmallCamera(camera, size);
}

double MedianFootprint(std::vector<float> distances, double pixel_angle) {
  std::erase(distances, 0.f);
  if (distances.empty()) return 0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return static_cast<double>(*middle) * pixel_angle;
}

// Views that are nearer, face the surface and see it away from edges count more.
void AddView(const ViewSurface& view,
             const Eigen::Vector3d& centre,
             double pixel_angle,
             const std::optional<nerf::CropBox>& crop,
             SurfelGrid* grid) {
  for (std::size_t i = 0; i < view.distance.size(); ++i) {
    const Eigen::Vector3d normal = view.normals[i].cast<double>();
    const double cosine = -normal.dot(view.rays[i]);
    if (view.support[i] < kMinSupport || cosine < kMinCosine) continue;
    if (crop && !nerf::Contains(*crop, centre + view.distance[i] * view.rays[i])) continue;
    const double distance = view.distance[i], spacing = distance * pixel_angle, even = view.evenness[i];
    grid->Add({.position = centre + distance * view.rays[i],
               .normal = normal,
               .rgb = Eigen::Vector3f(&view.rgb[3 * i]).cast<double>(),
               .spacing = spacing,
               .support = view.support[i]},
              cosine * std::pow(even, kEdgePower) / (spacing * spacing));
  }
}

}  // namespace

std::vector<Surfel> DenseSurface(const ExportedScene& scene, const SurfaceOptions& options) {
  io::Progress progress("surface");
  std::optional<SurfelGrid> grid;
  const std::size_t n = scene.train.frames.size();
  for (std::size_t i = 0; i < n; ++i) {
    io::ThrowIfInterrupted();
    const io::Frame& frame = scene.train.frames[i];
    const io::Camera camera =
        CameraFor(scene.train.cameras[static_cast<std::size_t>(frame.camera_index)], options.view_size);
    const double pixel_angle = nerf::PixelAngle(camera);
    const ViewSurface view = MeasureSurface(scene, camera, frame.world_from_cam);
    const double footprint = MedianFootprint(view.distance, pixel_angle);
    if (!grid && footprint > 0)
      grid.emplace(kFirstCell * footprint, static_cast<std::size_t>(options.max_points));
    if (grid) AddView(view, frame.world_from_cam.translation, pixel_angle, scene.crop, &*grid);
    progress.Update(static_cast<double>(i + 1) / static_cast<double>(n));
  }
  std::vector<Surfel> surfels;
  if (grid) surfels = grid->Thinned();
  if (surfels.empty())
    throw io::Error(io::ExitCode::kBadState,
                    scene.folder.parent_path().string() + ": no two training views show the same surface" +
                        (scene.crop ? " in the crop box" : ""),
                    scene.crop ? "Move the box" : "Train longer, or photograph more views");
  return surfels;
}

}  // namespace pipeline
