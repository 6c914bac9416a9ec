// What sparse points say about empty space: sight lines are free, surfaces and what lies behind them are not.
#include "nerf/data/sight_lines.h"

#include <gtest/gtest.h>

#include <vector>

namespace nerf {
namespace {

using Eigen::Vector3d;

// Cameras in a row, 0.5 apart, 3 before the origin; no pictures are needed.
io::Scene RowOfCameras(int n) {
  io::Scene scene;
  for (int i = 0; i < n; ++i) {
    io::Frame frame;
    frame.world_from_cam.translation = Vector3d(0.5 * (i - 0.5 * (n - 1)), -3, 0);
    scene.frames.push_back(frame);
  }
  return scene;
}

// Three points side by side: fewer are not believed.
void AddPoints(const Vector3d& xyz, const std::vector<int>& frame_indices, io::Scene* scene) {
  for (const double aside : {0.0, 1e-3, 2e-3})
    scene->points.push_back({.xyz = xyz + Vector3d(aside, 0, 0), .frame_indices = frame_indices});
}

struct Carving {
  Carving(const io::Scene& scene, bool unbounded, int threads)
      : contraction{{0, 0, 0}, unbounded ? 1.f : 4.f, unbounded}, grid(64, contraction) {
    for (std::uint32_t cell = 0; cell < grid.n_cells(); ++cell) grid.SetCandidate(cell);
    io::Workers workers(threads);
    n_lines = CarveBySightLines(scene, contraction, &workers, &grid);
  }
  bool IsFree(const Vector3d& x) const {
    const Eigen::Vector3f at = x.cast<float>();
    float unit[3];
    contraction.ToUnit(at.data(), unit);
    return grid.IsDeclaredEmpty(grid.CellAt(unit));
  }

  SceneContraction contraction;
  OccupancyGrid grid;
  std::size_t n_lines = 0;
};

TEST(CarveBySightLines, LinesAreFreeSurfacesAndWhatLiesBehindAreNot) {
  for (const bool unbounded : {false, true}) {
    io::Scene scene = RowOfCameras(3);
    AddPoints({0.2, 0.1, 0.3}, {0, 1, 2}, &scene);
    const Carving carving(scene, unbounded, 2);
    EXPECT_GT(carving.n_lines, 9u);
    const Vector3d point = scene.points[0].xyz;
    for (const io::Frame& frame : scene.frames) {
      const Vector3d camera = frame.world_from_cam.translation;
      for (double share = 0; share < 0.85; share += 0.01)
        EXPECT_TRUE(carving.IsFree(camera + share * (point - camera))) << unbounded << " " << share;
      EXPECT_FALSE(carving.IsFree(camera + 1.1 * (point - camera)));
    }
    EXPECT_FALSE(carving.IsFree(point));
    EXPECT_FALSE(carving.IsFree({0, -3, 1}));
    EXPECT_FALSE(carving.IsFree({3, -1, 0}));
  }
}

TEST(CarveBySightLines, TheViewStaysFreeBetweenTwoCamerasButNotFarApart) {
  io::Scene scene = RowOfCameras(9);
  // Seen from -2 and -0.5, 26 degrees apart, and from 2 and 0.5.
  AddPoints({0, 0, 0}, {0, 3, 5, 8}, &scene);
  EXPECT_TRUE(Carving(scene, false, 1).IsFree({-1.2, -2.9, 0}));
  scene.frames[0].world_from_cam.translation = {-3, -0.5, 0};
  scene.frames[3].world_from_cam.translation = {3, -0.5, 0};
  for (io::Point3D& point : scene.points) point.frame_indices = {0, 1, 3};
  EXPECT_FALSE(Carving(scene, false, 1).IsFree({0, -0.5, 0}));
}

// A point that was matched wrongly may lie anywhere, behind a wall too.
TEST(CarveBySightLines, FewerThanThreePointsAreNotBelieved) {
  io::Scene scene = RowOfCameras(3);
  for (int n = 1; n <= 3; ++n) {
    scene.points.push_back({.xyz = {0, 1 + 0.1 * n, 0}, .frame_indices = {0, 1, 2}});
    EXPECT_EQ(Carving(scene, false, 1).IsFree({0, -1, 0}), n == 3) << n;
  }
}

TEST(CarveBySightLines, SurfacesMayGrowBack) {
  io::Scene scene = RowOfCameras(3);
  AddPoints({0, 1, 0}, {0, 1, 2}, &scene);
  Carving carving(scene, false, 1);
  const Vector3d between(0, -1, 0);
  ASSERT_TRUE(carving.IsFree(between));
  carving.grid.Forget();
  float unit[3];
  carving.contraction.ToUnit(between.cast<float>().eval().data(), unit);
  carving.grid.SetCandidate(carving.grid.CellAt(unit) + 1);
  carving.grid.Rebuild();
  carving.grid.Settle();
  EXPECT_FALSE(carving.IsFree(between));
}

TEST(CarveBySightLines, CellsWithPointsStayWhateverCrossesThem) {
  io::Scene scene = RowOfCameras(3);
  AddPoints({0, 1, 0}, {0, 1, 2}, &scene);
  const Vector3d between(0, -1, 0);
  EXPECT_TRUE(Carving(scene, false, 1).IsFree(between));
  scene.points.push_back({.xyz = between, .frame_indices = {0, 1, 2}});
  EXPECT_FALSE(Carving(scene, false, 1).IsFree(between));
}

TEST(CarveBySightLines, PointsWithFewOrUnknownObserversSayNothing) {
  io::Scene scene = RowOfCameras(3);
  scene.points.push_back({.xyz = {0, 0, 0}, .frame_indices = {0, 1}});
  scene.points.push_back({.xyz = {0, 0, 0}});
  const Carving carving(scene, true, 2);
  EXPECT_EQ(carving.n_lines, 0u);
  for (std::uint32_t cell = 0; cell < carving.grid.n_cells(); ++cell)
    ASSERT_FALSE(carving.grid.IsDeclaredEmpty(cell));
}

// A step along a line must not vanish beside its length, nor a length overflow.
TEST(CarveBySightLines, PointsAndCamerasFarOutEndToo) {
  io::Scene scene = RowOfCameras(3);
  scene.frames[0].world_from_cam.translation = {0, -1e7, 0};
  AddPoints({0, 1.2e6, 0}, {0, 1, 2}, &scene);
  AddPoints({0, 2e6, 0}, {0, 1, 2}, &scene);
  AddPoints({1e30, 0, 0}, {0, 1, 2}, &scene);
  AddPoints({0.2, 0.1, 0.3}, {0, 1, 2}, &scene);
  const Vector3d half_way = 0.5 * (scene.frames[1].world_from_cam.translation + scene.points.back().xyz);
  EXPECT_TRUE(Carving(scene, true, 2).IsFree(half_way));
}

TEST(CarveBySightLines, TheSameForAnyNumberOfThreads) {
  io::Scene scene = RowOfCameras(7);
  for (int i = 0; i < 20; ++i)
    scene.points.push_back(
        {.xyz = {0.1 * i - 1, 0.02 * i * i, 1 - 0.1 * i}, .frame_indices = {i % 3, 3, 4, 5}});
  const Carving one(scene, true, 1), three(scene, true, 3);
  EXPECT_EQ(one.n_lines, three.n_lines);
  EXPECT_EQ(one.grid.density(), three.grid.density());
}

}  // namespace
}  // namespace nerf
