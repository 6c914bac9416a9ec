// Matchers of poses and scenes that print each part that differs, and by how much.
#pragma once

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>

#include "io/scene/scene.h"

namespace tests {

// Collects the parts that differ by more than a tolerance.
class Differences {
 public:
  explicit Differences(double tolerance) : tolerance_(tolerance) {}

  // Values of Eigen, by the norm of their difference. NaN differs from all.
  template <typename Matrix>
  void AddMatrix(const std::string& part, const Matrix& actual, const Matrix& expected) {
    AddDistance(part, (actual - expected).norm(), tolerance_);
  }
  void AddNumber(const std::string& part, double actual, double expected) {
    AddDistance(part, std::abs(actual - expected), tolerance_);
  }
  void AddDistance(const std::string& part, double distance, double tolerance) {
    if (!(distance <= tolerance)) text_ << "\n  " << part << " by " << distance;
  }
  template <typename Value>
  void AddExact(const std::string& part, const Value& actual, const Value& expected) {
    if (actual == expected) return;
    text_ << "\n  " << part << ": " << testing::PrintToString(actual) << " for "
          << testing::PrintToString(expected);
  }
  void AddPose(const std::string& part, const io::Rigid3d& actual, const io::Rigid3d& expected) {
    AddMatrix(part + "rotation", actual.rotation, expected.rotation);
    AddMatrix(part + "translation", actual.translation, expected.translation);
  }

  // Lists the parts for the reader of the test; true when there are none.
  bool AreNone(testing::MatchResultListener* listener) const {
    if (!text_.str().empty()) *listener << "which differs in" << text_.str();
    return text_.str().empty();
  }

 private:
  double tolerance_;
  std::ostringstream text_;
};

inline void AddCameras(const io::Scene& actual, const io::Scene& expected, Differences* differences) {
  differences->AddExact("number of cameras", actual.cameras.size(), expected.cameras.size());
  for (std::size_t i = 0; i < std::min(actual.cameras.size(), expected.cameras.size()); ++i) {
    const io::Camera &a = actual.cameras[i], &b = expected.cameras[i];
    const std::string part = "cameras[" + std::to_string(i) + "].";
    differences->AddExact(part + "width", a.width, b.width);
    differences->AddExact(part + "height", a.height, b.height);
    for (const auto& [name, member] : {std::pair("fl_x", &io::Camera::fl_x),
                                       std::pair("fl_y", &io::Camera::fl_y),
                                       std::pair("cx", &io::Camera::cx),
                                       std::pair("cy", &io::Camera::cy),
                                       std::pair("k1", &io::Camera::k1),
                                       std::pair("k2", &io::Camera::k2),
                                       std::pair("p1", &io::Camera::p1),
                                       std::pair("p2", &io::Camera::p2)}) {
      differences->AddNumber(part + name, a.*member, b.*member);
    }
  }
}

inline void AddFrames(const io::Scene& actual, const io::Scene& expected, Differences* differences) {
  differences->AddExact("number of frames", actual.frames.size(), expected.frames.size());
  for (std::size_t i = 0; i < std::min(actual.frames.size(), expected.frames.size()); ++i) {
    const io::Frame &a = actual.frames[i], &b = expected.frames[i];
    const std::string part = "frames[" + std::to_string(i) + "].";
    differences->AddExact(part + "image_path", a.image_path.string(), b.image_path.string());
    differences->AddExact(part + "mask_path", a.mask_path.string(), b.mask_path.string());
    differences->AddExact(part + "camera_index", a.camera_index, b.camera_index);
    differences->AddPose(part, a.world_from_cam, b.world_from_cam);
  }
}

inline void AddPoints(const io::Scene& actual, const io::Scene& expected, Differences* differences) {
  differences->AddExact("number of points", actual.points.size(), expected.points.size());
  for (std::size_t i = 0; i < std::min(actual.points.size(), expected.points.size()); ++i) {
    const io::Point3D &a = actual.points[i], &b = expected.points[i];
    const std::string part = "points[" + std::to_string(i) + "].";
    differences->AddMatrix(part + "xyz", a.xyz, b.xyz);
    differences->AddExact(part + "rgb", a.rgb, b.rgb);
    differences->AddNumber(part + "error_px", a.error_px, b.error_px);
    differences->AddExact(part + "frame_indices", a.frame_indices, b.frame_indices);
  }
}

// The rotations and the centres each lie within a tolerance, by the norm of their difference.
MATCHER_P3(PoseNear, expected, rotation_tolerance, centre_tolerance, "is the expected pose") {
  Differences differences(0);
  differences.AddDistance("rotation", (arg.rotation - expected.rotation).norm(), rotation_tolerance);
  differences.AddDistance("translation", (arg.translation - expected.translation).norm(), centre_tolerance);
  return differences.AreNone(result_listener);
}
inline auto PoseNear(const io::Rigid3d& expected, double tolerance) {
  return PoseNear(expected, tolerance, tolerance);
}

// Numbers lie within `tolerance`; names, counts and indices are equal.
MATCHER_P2(SceneNear, expected, tolerance, "is the expected scene") {
  Differences differences(tolerance);
  AddCameras(arg, expected, &differences);
  AddFrames(arg, expected, &differences);
  AddPoints(arg, expected, &differences);
  differences.AddNumber("near", arg.near, expected.near);
  differences.AddNumber("far", arg.far, expected.far);
  differences.AddMatrix("aabb.min", arg.aabb.min, expected.aabb.min);
  differences.AddMatrix("aabb.max", arg.aabb.max, expected.aabb.max);
  differences.AddExact("unbounded", arg.unbounded, expected.unbounded);
  const io::Sim3d &a = arg.scene_from_sfm, &b = expected.scene_from_sfm;
  differences.AddNumber("scene_from_sfm.scale", a.scale, b.scale);
  differences.AddMatrix("scene_from_sfm.rotation", a.rotation, b.rotation);
  differences.AddMatrix("scene_from_sfm.translation", a.translation, b.translation);
  return differences.AreNone(result_listener);
}

}  // namespace tests
