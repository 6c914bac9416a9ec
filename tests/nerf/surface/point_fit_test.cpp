// A plane that lies off its points: what moves, by how much, and what stays.
#include "nerf/surface/point_fit.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kFootprint = 0.01;
constexpr int kSide = 101;
constexpr float kPlane = 1.0f;  // side of the plane, which faces +z

io::Mesh Plane(float z, bool faces_up) {
  io::Mesh mesh;
  for (int i = 0; i < kSide * kSide; ++i) {
    const auto x = static_cast<float>(i % kSide), y = static_cast<float>(i / kSide);
    mesh.positions.push_back(kPlane / (kSide - 1) * Vector3f(x, y, 0) + Vector3f(0, 0, z));
    mesh.normals.push_back(faces_up ? Vector3f::UnitZ() : Vector3f(-Vector3f::UnitZ()));
    mesh.colours.push_back({});
  }
  return mesh;
}

// Points at a height with an error each, on the part of the plane with x < `until`.
std::vector<io::Point3D> PointsAt(double z, double error, double until = kPlane) {
  std::vector<io::Point3D> points;
  for (int i = 0; i < 40 * 40; ++i) {
    const Vector3d xy(i % 40 / 40.0, i / 40 / 40.0, 0);
    if (xy.x() >= until) continue;
    const double sign = i % 2 == 0 ? 1 : -1;
    points.push_back({.xyz = xy + Vector3d(0, 0, z + sign * error), .frame_indices = {0, 1}});
  }
  return points;
}

float HighestAndLowest(const io::Mesh& mesh, float* lowest) {
  float highest = mesh.positions[0].z();
  *lowest = highest;
  for (const Vector3f& p : mesh.positions) {
    highest = std::max(highest, p.z());
    *lowest = std::min(*lowest, p.z());
  }
  return highest;
}

class FitToPoints : public ::testing::Test {
 protected:
  io::Workers workers_{2};
};

TEST_F(FitToPoints, RemovesABiasThatIsSmallerThanThePointsErrors) {
  io::Mesh mesh = Plane(0.004f, true);
  const nerf::PointFit fit = nerf::FitToPoints(PointsAt(0, 0.006), kFootprint, &workers_, &mesh);
  EXPECT_EQ(fit.points, 1600u);
  float lowest;
  const float highest = HighestAndLowest(mesh, &lowest);
  EXPECT_LT(highest, 0.0015f);
  EXPECT_GT(lowest, -0.0015f);
}

TEST_F(FitToPoints, LeavesWhatIsFarFromEveryPoint) {
  io::Mesh mesh = Plane(0.004f, true);
  nerf::FitToPoints(PointsAt(0, 0, 0.4), kFootprint, &workers_, &mesh);
  for (const Vector3f& p : mesh.positions) {
    if (p.x() < 0.3f) {
      EXPECT_LT(p.z(), 0.001f);
    } else if (p.x() > 0.4f + nerf::kFitFootprints * kFootprint) {
      EXPECT_EQ(p.z(), 0.004f);
    }
  }
}

TEST_F(FitToPoints, PointsOfAnotherSurfaceHaveNoSay) {
  const io::Mesh before = Plane(0, true);
  io::Mesh mesh = before;
  const nerf::PointFit fit =
      nerf::FitToPoints(PointsAt(1.5 * nerf::kNearFootprints * kFootprint, 0), kFootprint, &workers_, &mesh);
  EXPECT_EQ(fit.points, 0u);
  EXPECT_EQ(mesh.positions, before.positions);
}

TEST_F(FitToPoints, TheBackOfAThinSheetStaysWhereItIs) {
  io::Mesh mesh = Plane(0.004f, true);
  const io::Mesh back = Plane(-0.02f, false);
  mesh.positions.insert(mesh.positions.end(), back.positions.begin(), back.positions.end());
  mesh.normals.insert(mesh.normals.end(), back.normals.begin(), back.normals.end());
  mesh.colours.resize(mesh.positions.size());
  nerf::FitToPoints(PointsAt(0, 0), kFootprint, &workers_, &mesh);
  for (std::size_t i = 0; i < back.positions.size(); ++i) {
    ASSERT_LT(mesh.positions[i].z(), 0.001f);
    ASSERT_EQ(mesh.positions[back.positions.size() + i].z(), -0.02f);
  }
}

TEST_F(FitToPoints, APointAloneMovesItLittle) {
  io::Mesh mesh = Plane(0, true);
  const std::vector<io::Point3D> points = {{.xyz = {0.5, 0.5, 0.01}, .frame_indices = {0, 1}},
                                           {.xyz = {0.2, 0.2, 0.01}, .frame_indices = {0}}};
  EXPECT_EQ(nerf::FitToPoints(points, kFootprint, &workers_, &mesh).points, 1u) << "one frame is no track";
  float lowest;
  const float highest = HighestAndLowest(mesh, &lowest);
  EXPECT_NEAR(highest, 0.01f / 5, 1e-4f);
  EXPECT_EQ(lowest, 0);
}

TEST_F(FitToPoints, IsTheSameForAnyNumberOfWorkers) {
  io::Mesh one = Plane(0.004f, true), three = one;
  io::Workers alone(1), many(3);
  nerf::FitToPoints(PointsAt(0, 0.006), kFootprint, &alone, &one);
  nerf::FitToPoints(PointsAt(0, 0.006), kFootprint, &many, &three);
  EXPECT_EQ(one.positions, three.positions);
}

TEST_F(FitToPoints, WithoutPointsNothingMoves) {
  io::Mesh mesh = Plane(0.004f, true);
  const io::Mesh before = mesh;
  EXPECT_EQ(nerf::FitToPoints({}, kFootprint, &workers_, &mesh).points, 0u);
  EXPECT_EQ(mesh.positions, before.positions);
}

}  // namespace
