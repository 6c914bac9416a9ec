// Cells of the occupancy grid, and where they lie in pinhole pictures.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>

#include "io/scene/scene.h"
#include "nerf/sampling/occupancy_grid.h"

namespace nerf {

// The corners of a cell and its centre, in scene coordinates.
using CellPoints = std::array<Eigen::Vector3f, 9>;

inline void CellPointsOf(const OccupancyGrid& grid,
                         const SceneContraction& contraction,
                         std::uint32_t cell,
                         CellPoints* points) {
  const std::array<float, 3> unit = grid.CellCentre(cell);
  const float half = 0.5f / static_cast<float>(grid.resolution());
  contraction.FromUnit(unit.data(), (*points)[8].data());
  for (std::size_t corner = 0; corner < 8; ++corner) {
    float at[3];
    // Cells on the faces of a contracted cube reach infinity; staying inside by 1 % of a cell keeps them
    // finite.
    for (std::size_t i = 0; i < 3; ++i) at[i] = unit[i] + (corner >> i & 1 ? 0.99f : -0.99f) * half;
    contraction.FromUnit(at, (*points)[corner].data());
  }
}

// Bounds the rounding of a corner's distance from a plane of the frustum, relative to the sum of its terms.
inline constexpr float kPlaneRounding = 1e-5f;

// A pinhole view, and what it sees of balls, boxes and cells. Scene coordinates; the camera looks along -z.
struct Projector {
  explicit Projector(const io::Scene& scene, const io::Frame& frame) {
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const io::Rigid3d cam_from_world = frame.world_from_cam.Inverse();
    rotation = cam_from_world.rotation.cast<float>();
    translation = cam_from_world.translation.cast<float>();
    position = frame.world_from_cam.translation.cast<float>();
    fl_x = static_cast<float>(camera.fl_x), fl_y = static_cast<float>(camera.fl_y);
    cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
    width = static_cast<float>(camera.width), height = static_cast<float>(camera.height);
  }

  // False when the ball reaches behind the camera, where its projection is no disc.
  bool Project(
      const Eigen::Vector3f& x, float radius, Eigen::Vector2f* centre, float* depth, float* radius_px) const {
    const Eigen::Vector3f in_cam = rotation * x + translation;
    *depth = -in_cam.z();
    if (!(*depth > radius)) return false;
    *centre = {fl_x * in_cam.x() / *depth + cx, -fl_y * in_cam.y() / *depth + cy};
    // The silhouette of a ball off the axis is stretched by at most 1 / cos; depth - radius bounds its near
    // side.
    const float slant = in_cam.norm() / *depth;
    *radius_px = std::max(fl_x, fl_y) * radius / (*depth - radius) * slant;
    return true;
  }
  bool Contains(const Eigen::Vector2f& p, float margin) const {
    return p.x() >= margin && p.y() >= margin && p.x() <= width - margin && p.y() <= height - margin;
  }

  // Whether a corner or the centre of the cell lies on a used pixel and beyond `near`, or the camera is
  // inside the cell. uses(x, y) tells used pixels.
  template <typename Uses>
  bool SeesAny(const CellPoints& points, float near, const Uses& uses) const {
    float nearest = std::numeric_limits<float>::infinity();
    for (const Eigen::Vector3f& point : points) {
      const Eigen::Vector3f in_cam = rotation * point + translation;
      const float depth = -in_cam.z(), distance = in_cam.norm();
      nearest = std::min(nearest, distance);
      if (!(depth > 0 && distance > near)) continue;
      const Eigen::Vector2f p(fl_x * in_cam.x() / depth + cx, -fl_y * in_cam.y() / depth + cy);
      if (Contains(p, 0) && uses(p.x(), p.y())) return true;
    }
    return nearest < (points[8] - points[0]).norm() && nearest > near;
  }

  // False when all corners of the box lie outside one plane of the frustum, so that no point of it is seen.
  bool MaySee(const Eigen::AlignedBox3f& box) const {
    std::array<int, 5> outside{};
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3f in_cam =
          rotation * box.corner(static_cast<Eigen::AlignedBox3f::CornerType>(corner)) + translation;
      const float depth = -in_cam.z(), x = fl_x * in_cam.x(), y = -fl_y * in_cam.y();
      const float slack = kPlaneRounding * in_cam.cwiseAbs().maxCoeff() * (width + height + fl_x + fl_y);
      outside[0] += depth < 0;
      outside[1] += x + cx * depth < -slack;
      outside[2] += x + (cx - width) * depth > slack;
      outside[3] += y + cy * depth < -slack;
      outside[4] += y + (cy - height) * depth > slack;
    }
    return std::count(outside.begin(), outside.end(), 8) == 0;
  }

  // Whether the cell lies nearer than `near`, with its centre on a used pixel.
  template <typename Uses>
  bool SeesThrough(const CellPoints& points, float near, const Uses& uses) const {
    for (auto point = points.rbegin(); point != points.rend(); ++point) {  // the centre decides nearly always
      if (!((*point - position).squaredNorm() < near * near)) return false;
    }
    const Eigen::Vector3f centre = rotation * points[8] + translation;
    const float depth = -centre.z();
    if (!(depth > 0)) return false;
    const Eigen::Vector2f p(fl_x * centre.x() / depth + cx, -fl_y * centre.y() / depth + cy);
    return Contains(p, 0) && uses(p.x(), p.y());
  }

  Eigen::Matrix3f rotation;
  Eigen::Vector3f translation, position;  // position: of the camera, scene coordinates
  float fl_x, fl_y, cx, cy, width, height;
};

}  // namespace nerf
