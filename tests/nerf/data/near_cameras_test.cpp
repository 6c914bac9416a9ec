// Nearness to cameras: that of the nearest one, on a lattice of the contracted cube.
#include "nerf/data/near_cameras.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/sphere_field.h"

namespace nerf {
namespace {

TEST(NearCameras, FallsFromOneAtACameraToNothingAtTheReach) {
  const io::Scene scene = tests::RingScene(5, 40, 30, [](int) { return ""; });
  const SceneContraction contraction = {{0.2f, 0, -0.1f}, 2.5f, true};
  io::Workers workers(2);
  const NearCameras near_cameras(scene, contraction, 2.5f, &workers);
  const auto at = [&](const Eigen::Vector3f& x) {
    float unit[3];
    contraction.ToUnit(x.data(), unit);
    return near_cameras.At(unit[0], unit[1], unit[2]);
  };
  // The centre of the lattice's cell lies within half its diagonal: in the inner cube, whose side takes up
  // half of the lattice, and where cameras stand, 1.6 half sides out, twice that.
  const float inner = std::sqrt(3.f) / 2 * 2 * contraction.half / (NearCameras::kSide / 2), outer = 3 * inner;
  for (const io::Frame& frame : scene.frames) {
    const Eigen::Vector3f camera = frame.world_from_cam.translation.cast<float>();
    EXPECT_NEAR(at(camera), 1, outer / contraction.half);
    const Eigen::Vector3f between = 0.6f * camera;  // 1.6 before this one, and farther from the others
    EXPECT_NEAR(at(between), 1 - 1.6f / 2.5f, inner / contraction.half);
  }
  EXPECT_EQ(at({0, 0, 0}), 0);  // 4 from all cameras
  EXPECT_EQ(at({0, 0, 100}), 0);
  EXPECT_EQ(near_cameras.At(0, 0.5f, 1), 0);  // the faces of the cube, at infinity
}

}  // namespace
}  // namespace nerf
