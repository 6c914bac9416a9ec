// The truth of the sample scene: distances are distances, rays end on surfaces, light throws shadows, and
// photographs agree with the poses that are written beside them.
#include "samples/still_life.h"

#include <gtest/gtest.h>

#include <set>

#include "samples/noise.h"
#include "samples/photograph.h"
#include "samples/room_paint.h"
#include "samples/trajectory.h"

namespace {

using samples::Vec3;

constexpr int kWidth = 96, kHeight = 72;

const samples::StillLife& SharedScene() {
  static const samples::StillLife scene({.seed = 1, .detail = 0.1, .threads = 2});
  return scene;
}

io::Camera SmallCamera() {
  return {.width = kWidth, .height = kHeight, .fl_x = 82, .fl_y = 82, .cx = 48, .cy = 36, .k1 = -0.06};
}

std::vector<samples::Solid> AllSolids() {
  std::vector<samples::Solid> solids = samples::FigurineSolids();
  for (const samples::Solid& solid : samples::TablewareSolids()) solids.push_back(solid);
  return solids;
}

Vec3 RandomPoint(int i, std::uint64_t seed) {
  return {samples::UnitHash(i, 0, seed) - 0.5,
          samples::UnitHash(i, 1, seed) - 0.5,
          samples::UnitHash(i, 2, seed) - 0.5};
}

TEST(Solids, DistanceNeverChangesFasterThanThePointMoves) {
  for (const samples::Solid& solid : AllSolids()) {
    for (int i = 0; i < 2000; ++i) {
      const Vec3 a = solid.centre + 2.2 * solid.radius * RandomPoint(i, 3);
      const Vec3 b = a + 0.05 * RandomPoint(i, 4);
      ASSERT_LE(std::abs(solid.distance(a) - solid.distance(b)), (a - b).norm() + 1e-12) << a.transpose();
    }
  }
}

TEST(Solids, LieInsideTheirBoundingSpheres) {
  for (const samples::Solid& solid : AllSolids()) {
    for (int i = 0; i < 3000; ++i) {
      const Vec3 on_sphere = solid.centre + solid.radius * RandomPoint(i, 5).normalized();
      EXPECT_GT(std::max(solid.distance(on_sphere), -on_sphere.z()), 0) << on_sphere.transpose();
    }
  }
}

TEST(BakedSolid, FindsWhatASlowWalkAlongTheRayFinds) {
  for (const samples::Solid& solid : AllSolids()) {
    const samples::BakedSolid baked(solid, 1);
    for (int i = 0; i < 60; ++i) {
      const Vec3 origin = solid.centre + 3 * solid.radius * RandomPoint(i, 6).normalized();
      const Vec3 direction = (solid.centre + solid.radius * RandomPoint(i, 7) - origin).normalized();
      double slow = 0;
      while (slow < 6 * solid.radius && solid.distance(origin + slow * direction) > 1e-4) {
        slow += solid.distance(origin + slow * direction);
      }
      const auto fast = baked.Intersect(origin, direction, 1e9);
      if (slow >= 6 * solid.radius) {
        EXPECT_FALSE(fast.has_value());
      } else {
        ASSERT_TRUE(fast.has_value());
        EXPECT_NEAR(*fast, slow, 5e-3);
      }
    }
  }
}

TEST(StillLife, DepthOfTableFloorAndWallIsThatOfTheirPlanes) {
  const Vec3 above_table(1.2, 0.7, 2);  // nothing stands there
  EXPECT_NEAR(SharedScene().Depth(above_table, -Vec3::UnitZ()), 2, 1e-12);
  const Vec3 beside(3, 0, 2);
  EXPECT_NEAR(SharedScene().Depth(beside, -Vec3::UnitZ()), 2 - samples::kFloorZ, 1e-12);
  EXPECT_NEAR(SharedScene().Depth(beside, Vec3::UnitX()), samples::kRoomRadius - 3, 1e-12);
}

TEST(StillLife, ThinAntennaIsHitFromAllSides) {
  for (int i = 0; i < 36; ++i) {
    const Vec3 eye = samples::TestPoses(36)[static_cast<std::size_t>(i)].translation;
    const Vec3 on_wire(0.045, 0.075, 1.23);  // in the middle of the first segment
    const double depth = SharedScene().Depth(eye, (on_wire - eye).normalized());
    EXPECT_NEAR(depth, (on_wire - eye).norm(), 0.05) << i;
  }
}

TEST(StillLife, FigurineThrowsAShadowAwayFromTheLamp) {
  const auto brightness = [&](const Vec3& p) {
    const Vec3 eye = p + Vec3(0, 0, 1.5);
    return SharedScene().Radiance(eye, -Vec3::UnitZ(), 0.02).sum();
  };
  // The lamp hangs at (2, -1.7): the linen left behind the owl is dark, the same linen before it is not.
  EXPECT_LT(brightness({-0.37, 0.3, 0}), 0.6 * brightness({0.37, -0.34, 0}));
}

TEST(StillLife, BlankRoomHasNoTexture) {
  const samples::StillLife blank({.seed = 1, .blank = true, .detail = 0.1, .threads = 1});
  const samples::Photographer photographer(SmallCamera(), 1, 1);
  const io::Image image = photographer.Take(blank, {samples::OrbitPoses(20, 1)[3]}, {});
  int largest_step = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 1; x < kWidth; ++x) {
      // Floor and wall differ in light where they meet; within each there is nothing to see.
      const int step = std::abs(image.Pixel(x, y)[1] - image.Pixel(x - 1, y)[1]);
      largest_step = std::max(largest_step, step);
    }
  }
  EXPECT_LT(largest_step, 40);
  std::set<int> steps;
  for (int x = 1; x < kWidth; ++x)
    steps.insert(std::abs(image.Pixel(x, kHeight - 1)[1] - image.Pixel(x - 1, kHeight - 1)[1]));
  EXPECT_LE(*steps.rbegin(), 2);
}

TEST(Photographer, PointsSeenInOnePhotographAreWhereTheTruthPutsThemInAnother) {
  const samples::Photographer photographer(SmallCamera(), 1, 2);
  const std::vector<io::Rigid3d> poses = samples::OrbitPoses(60, 1);
  const io::Rigid3d &a = poses[15], &b = poses[16];
  const std::vector<float> depth_a = photographer.TakeDepth(SharedScene(), a);
  int agreeing = 0, seen = 0;
  for (int y = 0; y < kHeight; y += 3) {
    for (int x = 0; x < kWidth; x += 3) {
      const Vec3 ray = io::RayFromImg(SmallCamera(), {x + 0.5, y + 0.5}).value();
      const Vec3 world = a * (depth_a[static_cast<std::size_t>(y * kWidth + x)] * ray);
      const Vec3 in_b = b.Inverse() * world;
      const auto xy = io::ImgFromCam(SmallCamera(), in_b);
      if (!xy || xy->x() < 0 || xy->y() < 0 || xy->x() >= kWidth || xy->y() >= kHeight) continue;
      ++seen;
      const double depth_b = SharedScene().Depth(b.translation, b.rotation * in_b.normalized());
      EXPECT_LE(depth_b, in_b.norm() + 1e-3);  // nothing is seen through
      agreeing += std::abs(depth_b - in_b.norm()) < 1e-3;
    }
  }
  EXPECT_GT(seen, 400);
  EXPECT_GT(agreeing, 0.8 * seen);  // the rest is occluded
}

TEST(Photographer, PixelShowsWhatTheRayThroughItsCentreSees) {
  const io::Rigid3d pose = samples::OrbitPoses(60, 1)[15];
  const io::Image image = samples::Photographer(SmallCamera(), 1, 2).Take(SharedScene(), {pose}, {});
  for (int y = 1; y < kHeight; y += 7) {
    for (int x = 1; x < kWidth; x += 7) {
      const Vec3 ray = io::RayFromImg(SmallCamera(), {x + 0.5, y + 0.5}).value();
      const Vec3 seen = SharedScene().Radiance(pose.translation, pose.rotation * ray, 1 / SmallCamera().fl_x);
      const double linear = std::clamp(seen.y(), 0.0031308, 1.0);
      // One level for rays kept in single precision.
      EXPECT_NEAR(image.Pixel(x, y)[1], 255 * (1.055 * std::pow(linear, 1 / 2.4) - 0.055), 1.6)
          << x << " " << y;
    }
  }
}

TEST(Photographer, ResultDoesNotDependOnTheNumberOfThreads) {
  const samples::StillLife one_thread({.seed = 1, .detail = 0.1, .threads = 1});
  const io::Rigid3d pose = samples::OrbitPoses(60, 1)[15];
  const samples::Exposure exposure{.ev = 0.1, .noise_sigma = 1.2, .noise_seed = 5};
  const io::Image a = samples::Photographer(SmallCamera(), 2, 1).Take(one_thread, {pose}, exposure);
  const io::Image b = samples::Photographer(SmallCamera(), 2, 3).Take(SharedScene(), {pose}, exposure);
  EXPECT_EQ(a.data, b.data);
}

TEST(Photographer, NoiseAndExposureAreWhatWasAskedFor) {
  const samples::Photographer photographer(SmallCamera(), 1, 2);
  const io::Rigid3d pose = samples::OrbitPoses(60, 1)[15];
  const io::Image clean = photographer.Take(SharedScene(), {pose}, {});
  const io::Image noisy =
      photographer.Take(SharedScene(), {pose}, {.ev = 0, .noise_sigma = 3, .noise_seed = 9});
  const io::Image bright = photographer.Take(SharedScene(), {pose}, {.ev = 0.5});
  double square = 0, ratio = 0;
  int middle_tones = 0;
  for (std::size_t i = 0; i < clean.data.size(); ++i) {
    if (clean.data[i] < 60 || clean.data[i] > 160) continue;
    const double difference = noisy.data[i] - clean.data[i];
    square += difference * difference;
    const auto linear = [](double byte) { return std::pow((byte / 255 + 0.055) / 1.055, 2.4); };
    ratio += linear(bright.data[i]) / linear(clean.data[i]);
    ++middle_tones;
  }
  ASSERT_GT(middle_tones, 5000);
  EXPECT_NEAR(std::sqrt(square / middle_tones), 3, 0.15);
  EXPECT_NEAR(ratio / middle_tones, std::sqrt(2.0), 0.01);
}

}  // namespace
