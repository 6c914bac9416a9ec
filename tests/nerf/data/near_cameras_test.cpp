// Nearness to cameras: that of the nearest one, on a lattice of the contracted cube.
#include "nerf/data/near_cameras.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/scenes/sphere_field.h"

namespace nerf {
namespace {

TEST(NearCameras, FallsFromOneAtACameraToNothingAtTheReach) {
  const io::Scene scene = tests::RingScene(5, 40, 30, [](int) { return ""; });
  const SceneContraction contraction = {{0.2f, 0, -0.1f}, 2.5f, true};
  io::Workers workers(2);
  const NearCameras near_cameras(scene, contraction, 2.5f, &workers);
  const auto at = [&](const Eigen::Vector3f& x) {
    std::array<float, 3> unit;
    contraction.ToUnit(x.data(), unit.data());
    return near_cameras.At(unit, {x.x(), x.y(), x.z()});
  };
  for (const io::Frame& frame : scene.frames) {
    const Eigen::Vector3f camera = frame.world_from_cam.translation.cast<float>();
    EXPECT_FLOAT_EQ(at(camera), 1);
    EXPECT_FLOAT_EQ(at(0.6f * camera), 1 - 1.6f / 2.5f);  // 1.6 before this one, and farther from the others
  }
  EXPECT_EQ(at({0, 0, 0}), 0);  // 4 from all cameras
  EXPECT_EQ(at({0, 0, 100}), 0);
  // Between two cameras the farther one may count, by less than a cell's diagonal.
  const Eigen::Vector3f a = scene.frames[0].world_from_cam.translation.cast<float>(),
                        b = scene.frames[1].world_from_cam.translation.cast<float>();
  for (float share = 0.4f; share < 0.6f; share += 0.01f) {
    const Eigen::Vector3f x = a + share * (b - a);
    const float nearness = std::max(0.f, 1 - std::min((x - a).norm(), (x - b).norm()) / 2.5f);
    EXPECT_LE(at(x), nearness + 1e-6f);
    EXPECT_GE(at(x), nearness - std::sqrt(3.f) * 3 * contraction.InnerSide() / NearCameras::kSide / 2.5f);
  }
}

}  // namespace
}  // namespace nerf
