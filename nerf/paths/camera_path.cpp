#include "nerf/paths/camera_path.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "io/base/check.h"
#include "io/scene/places.h"
#include "nerf/paths/path_shapes.h"

namespace nerf {
namespace {

using Eigen::Vector3d;

// Share of the cameras that must have the subject in their picture; the others took something beside it.
constexpr double kMinHitShare = 0.75;

// Whether the cameras go where they look, along a street or towards a subject: the way from each to its
// nearest neighbour leads more along its line of sight than across.
bool GoWhereTheyLook(const std::vector<io::Rigid3d>& cameras) {
  double along = 0, across = 0;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    Vector3d step = Vector3d::Zero();
    for (std::size_t j = 0; j < cameras.size(); ++j) {
      const Vector3d way = cameras[j].translation - cameras[i].translation;
      if (j != i && (step.isZero(0) || way.norm() < step.norm())) step = way;
    }
    const double ahead = step.dot(cameras[i].rotation.col(2));
    along += ahead * ahead;
    across += step.squaredNorm() - ahead * ahead;
  }
  return along > across;
}

// Whether all cameras look at much the same from side by side: each has what lies before their middle in its
// picture, and they spread more across their line of sight than along it.
bool StandTogether(const io::Scene& scene, const CaptureGeometry& capture) {
  const Vector3d target = capture.centre + capture.depth * capture.view;
  double along = 0, across = 0;
  for (const io::Frame& frame : scene.frames) {
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const auto xy = io::ImgFromCam(camera, frame.world_from_cam.Inverse() * target);
    if (!xy || xy->x() < 0 || xy->y() < 0 || xy->x() > camera.width || xy->y() > camera.height) return false;
    const Vector3d offset = frame.world_from_cam.translation - capture.centre;
    const double depth = offset.dot(capture.view);
    along += depth * depth;
    across += (offset - depth * capture.view).squaredNorm();
  }
  return across > along;
}

// Views of a panorama look to all sides: the first of each place is kept.
io::Scene OneViewPerPlace(const io::Scene& scene) {
  const std::vector<std::size_t> first = io::FirstAtPlace(scene.frames);
  io::Scene kept = scene;
  kept.frames.clear();
  for (std::size_t i = 0; i < first.size(); ++i) {
    if (first[i] == i) kept.frames.push_back(scene.frames[i]);
  }
  return kept;
}

}  // namespace

CameraPath FitCameraPath(const io::Scene& all, int frames) {
  PIPELINE_CHECK(frames >= 2);
  const io::Scene scene = OneViewPerPlace(all);
  CameraPath path;
  path.capture = MeasureCapture(scene);
  const std::vector<io::Rigid3d> cameras = PosesOf(scene);
  if (path.capture.hit_share >= kMinHitShare && !GoWhereTheyLook(cameras)) {
    FitOrbit(cameras, frames, &path);
  } else if (path.capture.hit_share < kMinHitShare && StandTogether(scene, path.capture)) {
    FitSway(cameras, frames, &path);
  } else {
    FitWalk(cameras, frames, &path);
  }
  for (const io::Rigid3d& pose : path.world_from_cam)
    path.distance += (pose.translation - path.capture.focus).norm() / frames;
  return path;
}

double TotalMotion(const CameraPath& path) {
  const std::vector<io::Rigid3d>& poses = path.world_from_cam;
  double sum = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) sum += Motion(poses[i - 1], poses[i], path.capture.depth);
  return sum;
}

double LargestDeparture(const CameraPath& path, const io::Scene& scene) {
  double largest = 0;
  for (const io::Rigid3d& pose : path.world_from_cam) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const io::Frame& frame : scene.frames)
      nearest = std::min(nearest, Motion(pose, frame.world_from_cam, path.capture.depth));
    largest = std::max(largest, nearest);
  }
  return largest;
}

std::string Describe(const CameraPath& path) {
  switch (path.kind) {
    case PathKind::kOrbit:
      return fmt::format("full orbit at distance {:.2f}, because cameras stood all around", path.distance);
    case PathKind::kArc:
      return fmt::format(
          "to and fro over {:.0f} degrees at distance {:.2f}, because no camera saw the other "
          "sides",
          path.arc_deg,
          path.distance);
    case PathKind::kSway:
      return "ellipse among the cameras, because they stood side by side and looked the same way";
    case PathKind::kWalk:
      return path.capture.hit_share >= kMinHitShare
                 ? "walk along the cameras, because they went where they looked"
                 : fmt::format(
                       "walk along the cameras, because their axes do not meet: the nearest point to "
                       "all lies in {:.0f} % of the pictures",
                       100 * path.capture.hit_share);
  }
  PIPELINE_CHECK(false);
}

}  // namespace nerf
