#include "nerf/fields/scene_field.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/base/median.h"
#include "nerf/data/occupancy_init.h"
#include "nerf/data/sight_lines.h"

namespace nerf {
namespace {

// Sampling interval, in pixel footprints. Unbounded scenes are crossed along much longer paths, mostly
// through thin leftovers; longer intervals buy more rays.
constexpr double kIntervalPixels = 1.5, kUnboundedIntervalPixels = 4.0;
constexpr int kLog2HashmapSize = 17;
// Of `near` and `far`: a point beyond is no point of the scene, and would leave it no usable size.
constexpr double kNearestSighting = 0.01, kFarthestSighting = 100;
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

// Distances at which cameras see sparse points, within what a scene may hold.
struct Sightings {
  std::vector<double> distances, footprints;  // footprint of a pixel there
};

// Of the observers of each point where they are known, else of all cameras that have it in their picture.
Sightings SightingsOf(const io::Scene& scene) {
  Sightings sightings;
  const auto add = [&](const io::Frame& frame, const io::Point3D& point, bool observes) {
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const Eigen::Vector3d x = frame.world_from_cam.Inverse() * point.xyz;
    const auto xy = io::ImgFromCam(camera, x);
    if (!xy) return;
    if (!observes && !(xy->x() >= 0 && xy->y() >= 0 && xy->x() <= camera.width && xy->y() <= camera.height))
      return;
    const double distance =
        std::clamp(x.norm(), kNearestSighting * scene.near, kFarthestSighting * scene.far);
    sightings.distances.push_back(distance);
    sightings.footprints.push_back(distance / camera.fl_x);
  };
  for (const io::Point3D& point : scene.points) {
    for (const int frame : point.frame_indices)
      add(scene.frames[static_cast<std::size_t>(frame)], point, true);
    if (!point.frame_indices.empty()) continue;
    for (const io::Frame& frame : scene.frames) add(frame, point, false);
  }
  return sightings;
}

// The space and the intervals in it, before the field's kind has its say.
struct Space {
  SceneContraction contraction;
  SamplerOptions sampling;
  double footprint = 0;  // of a pixel, at the centre
};

bool HasMasks(const io::Scene& scene) {
  return std::any_of(scene.frames.begin(), scene.frames.end(), [](const io::Frame& frame) {
    return !frame.mask_path.empty();
  });
}

// What the pictures alone say about empty space.
void Carve(const io::Scene& scene,
           const Dataset& dataset,
           const Space& space,
           io::Workers* workers,
           OccupancyGrid* grid) {
  const bool has_alpha = dataset.channels == 4;
  if (has_alpha) CarveByMasks(scene, dataset, space.contraction, workers, grid);
  if (!has_alpha || HasMasks(scene))
    CarveByFrusta(scene, dataset, space.contraction, space.sampling.near, workers, grid);
}

// Shrinks the bounded cube to that around the cells that may be occupied.
void ShrinkToHull(const io::Scene& scene, const Dataset& dataset, io::Workers* workers, Space* space) {
  SceneContraction& contraction = space->contraction;
  OccupancyGrid hull(kHullResolution, contraction);
  Carve(scene, dataset, *space, workers, &hull);
  const std::array<float, 6> box = hull.CandidateBox();
  float low[3], high[3], side = 0;
  contraction.FromUnit(&box[0], low);
  contraction.FromUnit(&box[3], high);
  for (int i = 0; i < 3; ++i) side = std::max(side, high[i] - low[i]);
  if (side <= 0) return;
  for (std::size_t i = 0; i < 3; ++i) contraction.centre[i] = 0.5f * (low[i] + high[i]);
  contraction.half = 0.5f * side;
}

double FootprintAtCentre(const io::Scene& scene, const SceneContraction& contraction) {
  const std::array<float, 3>& centre = contraction.centre;
  return PixelFootprint(scene, Eigen::Vector3d(centre[0], centre[1], centre[2]));
}

Space BoundedSpace(const io::Scene& scene, const Dataset& dataset, io::Workers* workers) {
  Space space{.contraction = SceneContraction::FromScene(scene, false)};
  space.sampling.near = static_cast<float>(0.5 * scene.near);
  space.sampling.far = static_cast<float>(scene.far);
  ShrinkToHull(scene, dataset, workers, &space);
  space.footprint = FootprintAtCentre(scene, space.contraction);
  space.sampling.step_size = static_cast<float>(kIntervalPixels * space.footprint);
  return space;
}

// The constants of an unbounded scene follow from what its cameras see. near is half the distance of the
// nearest thousandth: nothing reconstructed lies nearer, and density close to a lens would be fitted to that
// one view only. far is three times that of the farthest thousandth: content at infinity, put there, moves by
// a third of the parallax of the farthest point. Cells are equal in the cube and grow with the distance
// outside it, as pixel footprints do from a camera on: the cube reaches as far as cameras see in the median,
// and its cells are as fine as pixels there.
Space UnboundedSpace(const io::Scene& scene) {
  Space space{.contraction = SceneContraction::FromScene(scene, true)};
  std::vector<double> pixel_angles;
  for (const io::Frame& frame : scene.frames)
    pixel_angles.push_back(1 / scene.cameras[static_cast<std::size_t>(frame.camera_index)].fl_x);
  space.sampling.cone_angle =
      static_cast<float>(kUnboundedIntervalPixels * io::Median(std::move(pixel_angles)));
  space.footprint = FootprintAtCentre(scene, space.contraction);
  space.sampling.near = static_cast<float>(0.1 * scene.near);
  space.sampling.far = 32 * space.contraction.half;
  Sightings seen = SightingsOf(scene);
  if (!seen.distances.empty()) {
    space.sampling.near = static_cast<float>(std::min(0.5 * io::Quantile(seen.distances, 0.001), scene.near));
    space.sampling.far = static_cast<float>(std::max(3 * io::Quantile(seen.distances, 0.999), 2 * scene.far));
    space.contraction.half = static_cast<float>(io::Median(std::move(seen.distances)));
    space.footprint = io::Median(std::move(seen.footprints));
  }
  space.sampling.step_size = 0.5f * static_cast<float>(kUnboundedIntervalPixels * space.footprint);
  return space;
}

// Makes the field, says how large it is, and changes the sampling where the kind of field asks for it.
std::unique_ptr<RadianceField> MakeHashField(
    const io::Scene&, const SceneFieldOptions& options, std::uint64_t seed, Space* space, std::string* size) {
  HashFieldOptions field = {.bf16_network = options.bf16_network};
  HashGridOptions& grid = field.grid;
  grid.bf16 = options.bf16_table;
  grid.entry_moments = options.entry_moments;
  grid.log2_hashmap_size = options.log2_hashmap_size ? options.log2_hashmap_size : kLog2HashmapSize;
  const double cells = space->contraction.InnerSide() / (options.finest_cell_pixels * space->footprint);
  grid.finest_resolution = options.finest_resolution ? options.finest_resolution
                                                     : static_cast<int>(std::clamp(cells, 64.0, 8192.0));
  *size = fmt::format("{} levels, {} to {} cells, 2^{} entries",
                      grid.n_levels,
                      grid.base_resolution,
                      grid.finest_resolution,
                      grid.log2_hashmap_size);
  return std::make_unique<HashField>(field, seed);
}

std::unique_ptr<RadianceField> MakeMlpField(const io::Scene& scene,
                                            const SceneFieldOptions& options,
                                            std::uint64_t seed,
                                            Space* space,
                                            std::string* size) {
  const QuadratureOptions& quadrature = options.mlp.quadrature;
  SamplerOptions& sampling = space->sampling;
  sampling.scene_units = options.mlp.scene_units;
  if (quadrature.n_samples > 0) {
    sampling.near = static_cast<float>(scene.near);
    sampling.far = static_cast<float>(scene.far);
  } else if (!space->contraction.unbounded) {
    sampling.step_size = static_cast<float>((scene.far - scene.near) / kReportSamples);
  }
  auto field = std::make_unique<MlpField>(options.mlp, space->contraction.unbounded, seed);
  *size = fmt::format("{} weights", field->n_parameters());
  if (quadrature.n_samples > 0) {
    *size += fmt::format(", {} samples per ray, from near to far, not by intervals",
                         quadrature.n_samples + quadrature.n_importance);
  }
  return field;
}

std::string Derivation(const Space& space, const std::string& size, const SceneField& scene_field) {
  std::string text;
  if (const auto& background = scene_field.background) {
    const auto level = [&](std::size_t j) { return std::lround(255 * (*background)[j]); };
    text = fmt::format(
        "background of one colour ({}, {}, {}), which is not modelled; ", level(0), level(1), level(2));
  }
  const bool unbounded = space.contraction.unbounded;
  return text + fmt::format(
                    "pixel footprint {:.4g} units; {} cube of side {:.3g}; intervals {:.4g}{}; {}; "
                    "occupancy {}^3, {:.1f} % to start from",
                    space.footprint,
                    unbounded ? "contracted space around a" : "bounded",
                    2.0 * space.contraction.half,
                    static_cast<double>(space.sampling.step_size),
                    unbounded ? " and growing with distance" : "",
                    size,
                    scene_field.grid.resolution(),
                    100 * scene_field.grid.OccupiedShare());
}

}  // namespace

std::array<float, 3> SceneField::Background(bool has_alpha, const std::array<float, 3>& chosen) const {
  if (background) return *background;
  if (has_alpha) return chosen;
  const float grey = EndsAtInfinity() ? 0.f : 0.5f;
  return {grey, grey, grey};
}

std::unique_ptr<SceneField> MakeSceneField(const io::Scene& scene,
                                           const Dataset& dataset,
                                           const SceneFieldOptions& options,
                                           std::uint64_t seed,
                                           io::Workers* workers,
                                           std::string* derivation) {
  const bool has_alpha = dataset.channels == 4;
  Space space = has_alpha ? BoundedSpace(scene, dataset, workers) : UnboundedSpace(scene);
  std::string size;
  const auto make_field = options.kind == FieldKind::kHash ? MakeHashField : MakeMlpField;
  std::unique_ptr<RadianceField> field = make_field(scene, options, seed, &space, &size);
  const int grid_resolution = options.grid_resolution ? options.grid_resolution : kGridResolution;
  auto result =
      std::make_unique<SceneField>(space.contraction, space.sampling, std::move(field), grid_resolution);
  result->background = dataset.background;
  std::size_t n_sight_lines = 0;
  Carve(scene, dataset, space, workers, &result->grid);
  if (!has_alpha) n_sight_lines = CarveBySightLines(scene, space.contraction, workers, &result->grid);
  result->grid.Rebuild();
  *derivation = Derivation(space, size, *result);
  if (!has_alpha)
    *derivation += n_sight_lines > 0
                       ? fmt::format(", {} sight lines to sparse points are free", n_sight_lines)
                       : ", no sparse points with observers tell what is free";
  return result;
}

}  // namespace nerf
