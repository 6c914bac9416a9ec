// Which sparse points a field hides: the unit sphere, and points on it, before it and in it.
#include "nerf/rendering/hidden_points.h"

#include <gtest/gtest.h>

#include "tests/support/scenes/sphere_field.h"

namespace {

using Eigen::Vector3d;

class HiddenPoints : public testing::Test {
 protected:
  // As seen by the first camera.
  std::optional<double> Share() {
    return nerf::HiddenPointShare(field_, train_.cameras[0], train_.frames[0].world_from_cam, train_, 1);
  }
  // `n` points around a place that is so far from the middle of the sphere, towards the first camera.
  void Add(int n, double from_middle, const std::vector<int>& observers = {0}) {
    const Vector3d towards = train_.frames[0].world_from_cam.translation.normalized();
    for (int i = 0; i < n; ++i)
      train_.points.push_back(
          {.xyz = from_middle * towards + Vector3d(0, 0.01 * i, 0), .frame_indices = observers});
  }

  const tests::SphereField field_;
  io::Scene train_ = tests::RingScene(8, 120, 90, [](int) { return ""; });
};

TEST_F(HiddenPoints, AreThoseBehindASurface) {
  Add(30, 1);
  EXPECT_EQ(Share(), 0);
  Add(10, 0);  // a quarter of their distance behind the surface
  EXPECT_EQ(Share(), 0.25);
  Add(40, 2);  // before it: the field lacks what stands there, and hides nothing
  EXPECT_EQ(Share(), 0.125);
}

TEST_F(HiddenPoints, CountWhereATrainingViewSawThemFromAlike) {
  Add(30, 1);
  Add(30, 0, {4});  // from the other side, what hides them may be there in truth
  EXPECT_EQ(Share(), 0);
  Add(30, 0, {});  // nobody knows who saw them
  EXPECT_EQ(Share(), 0.5);
}

TEST_F(HiddenPoints, FewSayNothing) {
  Add(nerf::kFewestPoints - 1, 1);
  EXPECT_EQ(Share(), std::nullopt);
  Add(1, 1);
  EXPECT_EQ(Share(), 0);
}

}  // namespace
