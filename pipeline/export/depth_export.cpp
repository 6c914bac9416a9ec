#include "pipeline/export/depth_export.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/json.h"
#include "io/image/grey_png.h"
#include "io/image/image.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "pipeline/export/export_place.h"
#include "pipeline/export/view_surface.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Json;

constexpr double kMaxValue = 65535;
// The steps of 16 bits are chosen on pictures of this size ...
constexpr int kTrialSide = 64;
// ... to reach this far beyond all but the farthest of their pixels: the sky must not make all else coarse.
constexpr double kQuantile = 0.995, kMargin = 1.25;

// Cosine of the angle between a pixel's ray and the optical axis.
double AxisCosine(const ViewSurface& view, const io::Rigid3d& world_from_cam, std::size_t pixel) {
  return -world_from_cam.rotation.col(2).dot(view.rays[pixel]);
}

// Largest depth that the files can hold, in scene units.
double ChooseFar(const ExportedScene& scene, const std::vector<ExportedView>& views) {
  std::vector<float> distances;
  for (const ExportedView& view : views) {
    const nerf::RenderedView small = scene.field->Render(nerf::SmallCamera(*view.camera, kTrialSide),
                                                         view.frame->world_from_cam,
                                                         {.threads = scene.threads,
                                                          .step_scale = 1,
                                                          .samples_per_pixel = 1,
                                                          .limits = {.crop = scene.crop},
                                                          .depth_only = true});
    for (const float distance : small.median_depth)
      if (std::isfinite(distance)) distances.push_back(distance);
  }
  if (distances.empty()) return scene.train.far;
  const auto at =
      distances.begin() + static_cast<std::ptrdiff_t>(kQuantile * static_cast<double>(distances.size() - 1));
  std::nth_element(distances.begin(), at, distances.end());
  return kMargin * static_cast<double>(*at);
}

void WriteNormals(const ViewSurface& view, const Eigen::Matrix3d& world_from_cam, const fs::path& path) {
  io::Image image = io::MakeImage(view.width, view.height, 3);
  for (std::size_t i = 0; i < view.normals.size(); ++i) {
    if (view.normals[i].isZero()) continue;
    const Eigen::Vector3d normal = world_from_cam.transpose() * view.normals[i].cast<double>();
    for (int c = 0; c < 3; ++c) {
      image.data[3 * i + static_cast<std::size_t>(c)] =
          static_cast<std::uint8_t>(std::lround(std::clamp(127.5 * (normal[c] + 1), 0.0, 255.0)));
    }
  }
  io::WriteImage(path, image);
}

// Extends [*near, *far] by the depths written, in scene units.
void WriteDepth(const ViewSurface& view,
                const io::Rigid3d& world_from_cam,
                double step,
                const fs::path& path,
                double* near,
                double* far) {
  std::vector<std::uint16_t> values(view.distance.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double depth = view.distance[i] * AxisCosine(view, world_from_cam, i);
    const double value = std::round(depth / step);
    if (!(value >= 1 && value <= kMaxValue)) continue;
    values[i] = static_cast<std::uint16_t>(value);
    *near = std::min(*near, depth), *far = std::max(*far, depth);
  }
  io::WriteGreyPng(path, view.width, view.height, std::span<const std::uint16_t>(values));
}

void WriteSupport(const ViewSurface& view, const fs::path& path) {
  std::vector<std::uint8_t> values;
  for (const std::uint16_t views : view.support)
    values.push_back(static_cast<std::uint8_t>(std::min<int>(views, 255)));
  io::WriteGreyPng(path, view.width, view.height, std::span<const std::uint8_t>(values));
}

}  // namespace

void ExportDepth(const ExportedScene& scene, const fs::path& folder) {
  const std::vector<ExportedView> views = ViewsOf(scene);
  const double step = ChooseFar(scene, views) / kMaxValue, unit = scene.target.target_from_scene.scale;
  double near = std::numeric_limits<double>::infinity(), far = 0;
  io::Progress progress("depth");
  ExportFolder out(folder);
  Json frames = Json::array();
  for (const ExportedView& view : views) {
    io::ThrowIfInterrupted();
    const io::Rigid3d& pose = view.frame->world_from_cam;
    const ViewSurface surface = MeasureSurface(scene, *view.camera, pose);
    WriteDepth(surface, pose, step, out.path() / "depth" / view.name, &near, &far);
    WriteNormals(surface, pose.rotation, out.path() / "normals" / view.name);
    WriteSupport(surface, out.path() / "support" / view.name);
    frames.push_back({{"name", view.name}, {"split", view.is_test ? "test" : "train"}});
    progress.Update(static_cast<double>(frames.size()) / static_cast<double>(views.size()), view.name);
  }
  const Json record = {{"unit", scene.target.unit},
                       {"scale", step * unit},
                       {"depth", "scale * value, along the optical axis"},
                       {"invalid", 0},
                       {"near", far > 0 ? Json(near * unit) : Json()},
                       {"far", far > 0 ? Json(far * unit) : Json()},
                       {"normals", "value / 127.5 - 1; x right, y up, z back; 0 0 0: unknown"},
                       {"support", "training views that saw the same surface; 255: or more"},
                       {"frames", frames}};
  io::WriteFileAtomically(out.path() / "depth.json", io::DumpJson(record, 1) + "\n");
  out.Commit("depth", scene.target);
}

}  // namespace pipeline
