#include "nerf/surface/surface.h"

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/median.h"
#include "io/process/parallel.h"
#include "nerf/data/capture_geometry.h"
#include "nerf/surface/depth_fusion.h"
#include "nerf/surface/isosurface.h"
#include "nerf/surface/mesh_repair.h"
#include "nerf/surface/point_fit.h"
#include "nerf/surface/seen_vertices.h"

namespace nerf {
namespace {

using Eigen::Vector3d;

constexpr double kTruncationVoxels = 4;
constexpr double kLookingAtOnePlace = 0.5;  // share of the cameras
constexpr double kOutlyingPoints = 0.02;    // share on each side of an axis

double PixelFootprint(const io::Scene& train, const Vector3d& place) {
  std::vector<double> footprints;
  for (const io::Frame& frame : train.frames) {
    const io::Camera& camera = train.cameras[static_cast<std::size_t>(frame.camera_index)];
    const double scale =
        std::min(1.0, static_cast<double>(kMaxViewSide) / std::max(camera.width, camera.height));
    footprints.push_back((frame.world_from_cam.translation - place).norm() / (scale * camera.fl_x));
  }
  return io::Median(std::move(footprints));
}

void CheckOptions(const io::Aabb& box, const SurfaceOptions& options) {
  const Vector3d size = box.max - box.min;
  if (!(size.minCoeff() > 0) || !size.allFinite()) {
    throw io::Error(
        io::ExitCode::kBadInput,
        fmt::format("the box of the mesh is {:.3g} x {:.3g} x {:.3g}", size.x(), size.y(), size.z()),
        "Each side must be positive");
  }
  if (options.voxel != 0 && !(options.voxel >= kFinestShare * size.maxCoeff())) {
    throw io::Error(
        io::ExitCode::kBadInput,
        fmt::format("cells of {:.3g} are too fine for a box of {:.3g}", options.voxel, size.maxCoeff()),
        fmt::format("At most {:.0f} cells per side", 1 / kFinestShare));
  }
}

// Blocks of the lattice reach out of the box.
void KeepInside(const io::Aabb& box, io::Mesh* mesh) {
  std::vector<std::uint8_t> keep;
  for (const Eigen::Vector3f& p : mesh->positions) {
    const Vector3d at = p.cast<double>();
    keep.push_back((at.array() >= box.min.array()).all() && (at.array() <= box.max.array()).all());
  }
  KeepVertices(keep, mesh);
}

}  // namespace

io::Aabb CaptureBox(const io::Scene& train) {
  if (!train.unbounded || train.points.empty()) return train.aabb;
  if (MeasureCapture(train).hit_share >= kLookingAtOnePlace) return train.aabb;
  io::Aabb box;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const io::Point3D& point : train.points) values.push_back(point.xyz[axis]);
    box.min[axis] = io::Quantile(values, kOutlyingPoints);
    box.max[axis] = io::Quantile(std::move(values), 1 - kOutlyingPoints);
  }
  return box;
}

Surface ExtractSurface(const TrainedField& field, const io::Scene& train, const SurfaceOptions& options) {
  Surface surface;
  surface.box = options.box ? *options.box : CaptureBox(train);
  CheckOptions(surface.box, options);
  const Vector3d centre = 0.5 * (surface.box.min + surface.box.max);
  const double footprint = PixelFootprint(train, centre);
  surface.voxel = options.voxel > 0
                      ? options.voxel
                      : std::max(footprint, kFinestShare * (surface.box.max - surface.box.min).maxCoeff());
  const auto report = [&](const char* what) {
    return [&options, what](double share) {
      if (options.progress) options.progress(what, share);
    };
  };
  io::Workers workers(options.threads);
  const std::vector<DepthView> views = RenderDepthViews(field, train, options.threads, report("depth"));
  {
    const SparseVolume volume = FuseDepthViews(
        views,
        {.box = surface.box, .voxel = surface.voxel, .truncation = kTruncationVoxels * surface.voxel},
        &workers,
        report("fusion"));
    surface.blocks = volume.size();
    surface.mesh = ExtractIsosurface(volume, &workers);
  }
  KeepInside(surface.box, &surface.mesh);
  surface.extracted_triangles = surface.mesh.triangles.size();
  const std::vector<int> n_views = ColourVertices(views, &workers, &surface.mesh);
  std::vector<std::uint8_t> keep(n_views.size());
  for (std::size_t i = 0; i < keep.size(); ++i) keep[i] = n_views[i] >= options.least_views;
  KeepVertices(keep, &surface.mesh);
  surface.unseen_triangles = surface.extracted_triangles - surface.mesh.triangles.size();
  surface.pieces = DropSmallPieces(options.least_piece, &surface.mesh);
  const std::size_t before = surface.mesh.triangles.size();
  Decimate(options.triangles, &surface.mesh);
  surface.decimated_triangles = before - surface.mesh.triangles.size();
  if (surface.mesh.triangles.empty()) {
    throw io::Error(io::ExitCode::kBadInput,
                    fmt::format("no surface in the box is seen by {} training views", options.least_views),
                    "Give a box around the subject, or train longer");
  }
  const PointFit fit = FitToPoints(train.points, footprint, &workers, &surface.mesh);
  surface.fitted_points = fit.points;
  surface.point_offset_px = fit.median_offset / footprint;
  surface.area = Area(surface.mesh);
  report("mesh")(1);
  return surface;
}

std::vector<std::string> Surface::Decisions() const {
  std::vector<std::string> lines = {
      fmt::format("box: [{:.2f}, {:.2f}] x [{:.2f}, {:.2f}] x [{:.2f}, {:.2f}]",
                  box.min.x(),
                  box.max.x(),
                  box.min.y(),
                  box.max.y(),
                  box.min.z(),
                  box.max.z()),
      fmt::format("cells of {:.4g} scene units, {} blocks of 8^3", voxel, blocks),
      fmt::format("{} triangles of the zero set, less {} that too few views see and {} small pieces",
                  extracted_triangles,
                  unseen_triangles,
                  pieces),
      fmt::format("{} triangles and {} vertices, {} less than before decimation",
                  mesh.triangles.size(),
                  mesh.positions.size(),
                  decimated_triangles)};
  if (fitted_points > 0) {
    lines.push_back(
        fmt::format("{:.2f} pixels before the {} sparse points near it (median), and moved to them",
                    -point_offset_px,
                    fitted_points));
  }
  return lines;
}

}  // namespace nerf
