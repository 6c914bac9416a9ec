#include "nerf/surface/seen_vertices.h"

#include <cmath>

#include "io/process/interrupt.h"

namespace nerf {
namespace {

using Eigen::Vector3f;

constexpr std::size_t kVerticesPerTask = 4096;

}  // namespace

std::vector<int> ColourVertices(std::span<const DepthView> views, io::Workers* workers, io::Mesh* mesh) {
  const std::size_t n = mesh->positions.size();
  std::vector<int> n_views(n, 0);
  std::vector<float> weights(n, 0);
  std::vector<Vector3f> colours(n, Vector3f::Zero());
  const int n_tasks = static_cast<int>((n + kVerticesPerTask - 1) / kVerticesPerTask);
  for (const DepthView& view : views) {
    io::ThrowIfInterrupted();
    const std::vector<Facet> facets = FacetsOf(view, workers);
    const io::Camera& camera = view.camera;
    const double pixel_angle = 1 / std::sqrt(camera.fl_x * camera.fl_y);
    workers->Run(n_tasks, [&](int task, int) {
      const std::size_t first = static_cast<std::size_t>(task) * kVerticesPerTask;
      for (std::size_t i = first; i < std::min(n, first + kVerticesPerTask); ++i) {
        const Eigen::Vector3d in_cam = view.cam_from_world * mesh->positions[i].cast<double>();
        const auto xy = io::ImgFromCam(camera, in_cam);
        if (!xy || !(xy->x() >= 0 && xy->y() >= 0 && xy->x() < camera.width && xy->y() < camera.height))
          continue;
        const auto pixel =
            static_cast<std::size_t>(static_cast<int>(xy->y()) * camera.width + static_cast<int>(xy->x()));
        const Facet& facet = facets[pixel];
        const Vector3f at = in_cam.cast<float>();
        const Vector3f normal = view.cam_from_world.rotation.cast<float>() * mesh->normals[i];
        if (facet.weight == 0 || -normal.dot(at.normalized()) < kLeastFacing) continue;
        const float tolerance = kSeenFootprints * static_cast<float>(pixel_angle * in_cam.norm());
        if (!(std::abs(facet.normal.dot(at - facet.point)) <= tolerance)) continue;
        ++n_views[i];
        weights[i] += facet.weight;
        for (int c = 0; c < 3; ++c)
          colours[i][c] +=
              facet.weight * static_cast<float>(view.rgb[3 * pixel + static_cast<std::size_t>(c)]);
      }
    });
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t c = 0; c < 3 && n_views[i] > 0; ++c)
      mesh->colours[i][c] =
          static_cast<std::uint8_t>(std::lround(colours[i][static_cast<int>(c)] / weights[i]));
  }
  return n_views;
}

}  // namespace nerf
