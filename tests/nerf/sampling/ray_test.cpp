// Rays of a camera: unit vectors, and only of cameras that have some.
#include "nerf/sampling/ray.h"

#include <cmath>
#include <limits>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace nerf {
namespace {

// Distances along a ray are scene units whatever the focal length, so lengths need no factor.
TEST(RayCamera, DirectionsAreUnitVectorsForAnyFocalLength) {
  io::Rigid3d world_from_cam;
  world_from_cam.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  for (const double scale : {0.1, 0.3, 1.0, 3.0, 10.0}) {
    io::Camera camera;
    camera.width = 64, camera.height = 48;
    camera.fl_x = 64 * scale, camera.fl_y = 50 * scale;
    camera.cx = 31, camera.cy = 25;
    const RayCamera rays(camera, world_from_cam);
    for (int y = 0; y < 48; y += 47) {
      for (int x = 0; x < 64; x += 7) {
        double squared = 0;
        for (const float d : rays.RayThrough(x, y).direction) squared += double{d} * double{d};
        EXPECT_NEAR(std::sqrt(squared), 1, 1e-6) << scale;
      }
    }
  }
}

TEST(RayCamera, DistortionAndWhatIsNotFiniteAreRefused) {
  io::Camera camera;
  camera.width = 64, camera.height = 48;
  camera.fl_x = camera.fl_y = 70, camera.cx = 32, camera.cy = 24;
  EXPECT_NO_THROW(RayCamera(camera, io::Rigid3d()));
  io::Camera bent = camera;
  bent.k1 = 0.1;
  EXPECT_ERROR(
      RayCamera(bent, io::Rigid3d()), io::ExitCode::kBadInput, "lens distortion", "pipeline normalize");
  const double nan = std::numeric_limits<double>::quiet_NaN(), huge = std::numeric_limits<double>::infinity();
  for (double io::Camera::*value : {&io::Camera::fl_x, &io::Camera::fl_y, &io::Camera::cx, &io::Camera::cy}) {
    io::Camera other = camera;
    other.*value = nan;
    EXPECT_ERROR(RayCamera(other, io::Rigid3d()), io::ExitCode::kBadInput, "not finite");
  }
  io::Rigid3d pose;
  pose.translation.y() = huge;
  EXPECT_ERROR(RayCamera(camera, pose), io::ExitCode::kBadInput, "not finite");
  pose = {};
  pose.rotation(1, 2) = nan;
  EXPECT_ERROR(RayCamera(camera, pose), io::ExitCode::kBadInput, "not finite");
}

}  // namespace
}  // namespace nerf
