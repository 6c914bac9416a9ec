#include "nerf/fields/scene_field.h"
#include "io/base/median.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "nerf/data/occupancy_init.h"

namespace nerf {
namespace {

// Sampling interval, in pixel footprints. Unbounded scenes are crossed along much longer paths, mostly
// through thin leftovers; longer intervals buy more rays.
constexpr double kIntervalPixels = 1.5, kUnboundedIntervalPixels = 4.0;
constexpr int kLog2HashmapSize = 17;
constexpr int kReportSamples = 192;
constexpr int kGridResolution = 128;
constexpr int kHullResolution = 64;  // of the first carving, which only finds the box

double PixelFootprint(const io::Scene& scene, const Eigen::Vector3d& centre) {
  std::vector<double> footprints;
  for (const io::Frame& frame : scene.frames) {
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    footprints.push_back((frame.world_from_cam.translation - centre).norm() / camera.fl_x);
  }
  return io::Median(std::move(footprints));
}

// What the sparse points say about an unbounded scene.
struct PointExtent {
  double near, far;  // distances from the cameras between which everything visible lies
  double half;  // half side of the cube, around the centre of the region of interest, to model undistorted
};

// near is half the distance of the nearest thousandth of (view, point) pairs: nothing reconstructed lies
// nearer, and density close to a lens would be fitted to that one view only. far is three times the farthest
// thousandth: content at infinity, put there, moves by a third of the parallax of the farthest point. The
// cube holds 90 % of the points, within one to two times the region of interest, since resolution is shared
// by all that it holds.
PointExtent ExtentOf(const io::Scene& scene, const SceneContraction& map) {
  std::vector<double> distances, reaches;
  for (const io::Frame& frame : scene.frames) {
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const io::Rigid3d cam_from_world = frame.world_from_cam.Inverse();
    for (const io::Point3D& point : scene.points) {
      const Eigen::Vector3d x = cam_from_world * point.xyz;
      const auto xy = io::ImgFromCam(camera, x);
      if (xy && xy->x() >= 0 && xy->y() >= 0 && xy->x() <= camera.width && xy->y() <= camera.height) {
        distances.push_back(x.norm());
      }
    }
  }
  const double half = map.half;
  if (distances.empty()) return {0.1 * scene.near, 32 * half, half};
  for (const io::Point3D& point : scene.points) {
    const Eigen::Vector3f x = point.xyz.cast<float>();
    reaches.push_back(map.Reach(x.data()));
  }
  return {std::clamp(0.5 * io::Quantile(distances, 0.001), 0.01 * scene.near, scene.near),
          std::max(3 * io::Quantile(distances, 0.999), 2 * scene.far),
          half * std::clamp(io::Quantile(reaches, 0.9), 1.0, 2.0)};
}

}  // namespace

std::unique_ptr<SceneField> MakeSceneField(const io::Scene& scene,
                                           const Dataset& dataset,
                                           const SceneFieldOptions& options,
                                           std::uint64_t seed,
                                           io::Workers* workers,
                                           std::string* derivation) {
  const bool has_alpha = dataset.channels == 4;
  SceneContraction map = SceneContraction::FromScene(scene, !has_alpha);
  const int grid_resolution = options.grid_resolution ? options.grid_resolution : kGridResolution;
  PointExtent extent = {};
  if (map.unbounded) {
    extent = ExtentOf(scene, map);
    map.half = static_cast<float>(extent.half);
  }
  if (has_alpha) {
    OccupancyGrid hull(kHullResolution, map);
    const std::array<float, 6> box = CarveByMasks(scene, dataset, map, workers, &hull);
    float low[3], high[3], side = 0;
    map.FromUnit(&box[0], low);
    map.FromUnit(&box[3], high);
    for (int i = 0; i < 3; ++i) side = std::max(side, high[i] - low[i]);
    if (side > 0) {
      for (std::size_t i = 0; i < 3; ++i) map.centre[i] = 0.5f * (low[i] + high[i]);
      map.half = 0.5f * side;
    }
  }
  const Eigen::Vector3d centre(map.centre[0], map.centre[1], map.centre[2]);
  const double footprint = PixelFootprint(scene, centre);
  SamplerOptions sampling;
  if (map.unbounded) {
    const double distance = 0.5 * (scene.near + scene.far);
    sampling.near = static_cast<float>(extent.near);
    sampling.far = static_cast<float>(extent.far);
    sampling.cone_angle = static_cast<float>(kUnboundedIntervalPixels * footprint / distance);
    sampling.step_size = 0.5f * static_cast<float>(kUnboundedIntervalPixels * footprint);
  } else {
    sampling.near = static_cast<float>(0.5 * scene.near);
    sampling.far = static_cast<float>(scene.far);
    sampling.step_size = static_cast<float>(kIntervalPixels * footprint);
  }
  std::unique_ptr<RadianceField> field;
  std::string size;
  if (options.field == "nerf") {
    const MlpFieldOptions& nerf = options.nerf;
    sampling.scene_units = nerf.scene_units;
    if (nerf.quadrature.n_samples > 0) {
      sampling.near = static_cast<float>(scene.near);
      sampling.far = static_cast<float>(scene.far);
    } else if (!map.unbounded) {
      sampling.step_size = static_cast<float>((scene.far - scene.near) / kReportSamples);
    }
    auto network = std::make_unique<MlpField>(nerf, map.unbounded, seed);
    size = std::to_string(network->n_parameters()) + " weights";
    if (nerf.quadrature.n_samples > 0) {
      size += ", " + std::to_string(nerf.quadrature.n_samples + nerf.quadrature.n_importance) +
              " samples per ray, from near to far, not by intervals";
    }
    field = std::move(network);
  } else {
    HashFieldOptions hash_options = {.bf16_network = options.bf16_network};
    HashGridOptions& hash = hash_options.grid;
    hash.bf16 = options.bf16_table;
    hash.entry_moments = options.entry_moments;
    hash.log2_hashmap_size = options.log2_hashmap_size ? options.log2_hashmap_size : kLog2HashmapSize;
    const double cells = map.InnerSide() / (options.finest_cell_pixels * footprint);
    hash.finest_resolution = options.finest_resolution ? options.finest_resolution
                                                       : static_cast<int>(std::clamp(cells, 64.0, 8192.0));
    size = std::to_string(hash.n_levels) + " levels, " + std::to_string(hash.base_resolution) + " to " +
           std::to_string(hash.finest_resolution) + " cells, 2^" + std::to_string(hash.log2_hashmap_size) +
           " entries";
    field = std::make_unique<HashField>(hash_options, seed);
  }

  auto result = std::make_unique<SceneField>(map, sampling, std::move(field), grid_resolution);
  result->background = dataset.background;
  if (has_alpha) {
    CarveByMasks(scene, dataset, map, workers, &result->grid);
  } else {
    CarveByFrusta(scene, dataset, map, sampling.near, workers, &result->grid);
  }
  result->grid.Rebuild();
  char text[400];
  std::snprintf(
      text,
      sizeof text,
      "pixel footprint %.4g units; %s cube of side %.3g; intervals %.4g%s; %s; occupancy %d^3, %.1f %% to "
      "start from",
      footprint,
      map.unbounded ? "contracted space around a" : "bounded",
      2.0 * map.half,
      static_cast<double>(sampling.step_size),
      map.unbounded ? " and growing with distance" : "",
      size.c_str(),
      grid_resolution,
      100 * result->grid.OccupiedShare());
  *derivation = text;
  if (dataset.background) {
    const auto level = [&](std::size_t j) { return std::lround(255 * (*dataset.background)[j]); };
    std::snprintf(text,
                  sizeof text,
                  "background of one colour (%ld, %ld, %ld), which is not modelled; ",
                  level(0),
                  level(1),
                  level(2));
    *derivation = text + *derivation;
  }
  return result;
}

}  // namespace nerf
