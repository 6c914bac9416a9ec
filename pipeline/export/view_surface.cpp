#include "pipeline/export/view_surface.h"

#include <cmath>

#include "io/process/parallel.h"
#include "io/scene/decomposition.h"

namespace pipeline {
namespace {

using Eigen::Vector3d;

// The plane goes through the pixels of a square with this half side: 5 x 5 pixels even out what is left of
// the sampling interval in the depth, and still follow edges.
constexpr int kReach = 2;
// A neighbour lies on the same surface when its distance differs by at most so many footprints for each pixel
// between the two: a slant of 80 degrees.
constexpr double kSteepest = 6;
// Fewer points say nothing about a plane.
constexpr int kMinPoints = 6;

// The normal at pixel (x, y), towards the camera, or 0; and the evenness. Points are relative to the camera.
Vector3d NormalAt(const ViewSurface& view, double pixel_angle, int x, int y, float* evenness) {
  const auto at = [&](int column, int row) { return static_cast<std::size_t>(row * view.width + column); };
  const double distance = view.distance[at(x, y)], footprint = pixel_angle * distance;
  const Vector3d place = distance * view.rays[at(x, y)];
  Vector3d sum = Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  int n = 0, n_all = 0;
  for (int v = std::max(0, y - kReach); v <= std::min(view.height - 1, y + kReach); ++v) {
    for (int u = std::max(0, x - kReach); u <= std::min(view.width - 1, x + kReach); ++u) {
      ++n_all;
      const double other = view.distance[at(u, v)];
      const int pixels = std::max(std::abs(u - x), std::abs(v - y));
      if (other == 0 || std::abs(other - distance) > kSteepest * footprint * pixels) continue;
      const Vector3d offset = other * view.rays[at(u, v)] - place;
      sum += offset;
      squares += offset * offset.transpose();
      ++n;
    }
  }
  *evenness = static_cast<float>(n) / static_cast<float>(n_all);
  if (n < kMinPoints) return Vector3d::Zero();
  const Vector3d normal = io::EigenDecomposition(squares - sum * sum.transpose() / n).vectors.col(0);
  return normal.dot(view.rays[at(x, y)]) > 0 ? Vector3d(-normal) : normal;
}

}  // namespace

ViewSurface MeasureSurface(const ExportedScene& scene,
                           const io::Camera& camera,
                           const io::Rigid3d& world_from_cam) {
  const int threads = scene.threads;
  // With one ray per pixel the median depth is a place on a surface, also at edges.
  nerf::RenderedView rendered = scene.field->Render(
      camera, world_from_cam, {.threads = threads, .samples_per_pixel = 1, .limits = {.crop = scene.crop}});
  ViewSurface view{.width = camera.width, .height = camera.height, .rgb = std::move(rendered.rgb)};
  const std::size_t n = rendered.median_depth.size();
  view.rays.resize(n), view.distance.resize(n), view.normals.resize(n), view.support.resize(n);
  view.evenness.resize(n);
  const double pixel_angle = nerf::PixelAngle(camera);
  const auto height = static_cast<std::size_t>(camera.height), width = static_cast<std::size_t>(camera.width);
  io::ParallelFor(height, threads, [&](std::size_t y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t i = y * width + x;
      view.rays[i] = world_from_cam.rotation *
                     *io::RayFromImg(camera, {static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5});
      const float distance = rendered.median_depth[i];
      if (!std::isfinite(distance)) continue;
      view.distance[i] = distance;
      const Vector3d point = world_from_cam.translation + static_cast<double>(distance) * view.rays[i];
      view.support[i] =
          static_cast<std::uint16_t>(scene.support->ViewsOf(point, world_from_cam.translation, pixel_angle));
    }
  });
  io::ParallelFor(height, threads, [&](std::size_t y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t i = y * width + x;
      view.normals[i].setZero();
      if (view.distance[i] == 0) continue;
      view.normals[i] =
          NormalAt(view, pixel_angle, static_cast<int>(x), static_cast<int>(y), &view.evenness[i])
              .cast<float>();
    }
  });
  return view;
}

}  // namespace pipeline
