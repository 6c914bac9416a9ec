// What pictures alone say about empty space: hulls of masks, frusta, and the pixels that can show anything.
#include "nerf/data/occupancy_init.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "io/base/random.h"
#include "io/image/image.h"
#include "io/image/mask.h"
#include "nerf/data/hull_pixels.h"
#include "nerf/data/projector.h"
#include "tests/support/files/picture_scene.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"
#include "tests/support/scenes/march_ray.h"

namespace nerf {
namespace {

// Counts of opaque pixels wrap at 2^16: squares of 256 pixels, which the radius passes here, must not look
// empty.
TEST(CarveByMasks, LargeOpaqueSquaresAreNotEmpty) {
  const TempDir dir;
  io::Image opaque = io::MakeImage(512, 512, 4);
  std::fill(opaque.data.begin(), opaque.data.end(), 255);
  opaque.data[3] = 0;  // else alpha would be dropped
  io::WriteImage(dir / "a.png", opaque);
  io::Scene scene = tests::SceneOf({dir / "a.png"}, 512, 512);
  const SceneContraction contraction{.centre = {0, 0, 0}, .half = 1};
  // Before the centre of one of the first blocks, which have a quarter of the cube's side.
  scene.frames[0].world_from_cam.translation = {0.25, 0.25, 4.25};
  const Dataset dataset = LoadDataset(scene, 1);
  io::Workers workers(1);
  for (double focal = 980; focal < 1080; focal += 2) {
    scene.cameras[0].fl_x = scene.cameras[0].fl_y = focal;
    OccupancyGrid grid(64, contraction);
    CarveByMasks(scene, dataset, contraction, &workers, &grid);
    const float inside[3] = {0.6f, 0.6f, 0.6f};
    EXPECT_FALSE(grid.IsDeclaredEmpty(grid.CellAt(inside))) << focal;
  }
}

// Every point of the ball lies in a candidate cell; a cell whose eight corners one view sees well beside the
// ball is empty; the box holds the candidates and no more.
TEST(CarveByMasks, HullHoldsTheBallAndIsTight) {
  const TempDir dir;
  const io::Scene scene = tests::BallScene(dir.path(), 12, 0, {.size = 96});
  const SceneContraction contraction = SceneContraction::FromScene(scene, false);
  io::Workers workers(2);
  OccupancyGrid grid(64, contraction);
  CarveByMasks(scene, LoadDataset(scene, 1), contraction, &workers, &grid);
  const std::array<float, 6> box = grid.CandidateBox();
  // In the picture the ball's disc has a radius of 0.8 / 4 of the focal length, a little more off the centre;
  // two pixels cover the edge and the square around a cell's ball.
  const double disc = 1.05 * 0.2 * scene.cameras[0].fl_x + 2;
  const double cell_px = scene.cameras[0].fl_x * 2.4 / 64 / 2.8;
  std::array<float, 6> candidates = {1, 1, 1, 0, 0, 0};
  int n_candidates = 0;
  for (std::uint32_t cell = 0; cell < grid.n_cells(); ++cell) {
    const std::array<float, 3> unit = grid.CellCentre(cell);
    Eigen::Vector3f x;
    contraction.FromUnit(unit.data(), x.data());
    const bool candidate = !grid.IsDeclaredEmpty(cell);
    ASSERT_TRUE(candidate || x.norm() > 0.8f) << x.transpose();
    bool beside = false;
    for (const io::Frame& frame : scene.frames) {
      const auto at = io::ImgFromCam(scene.cameras[0], frame.world_from_cam.Inverse() * x.cast<double>());
      ASSERT_TRUE(at);
      const double margin = 2 * cell_px;
      const bool inside = at->minCoeff() > margin && at->maxCoeff() < 96 - margin;
      beside |= inside && (*at - Eigen::Vector2d(48, 48)).norm() > disc + margin;
    }
    ASSERT_FALSE(beside && candidate) << x.transpose();
    if (!candidate) continue;
    ++n_candidates;
    for (std::size_t i = 0; i < 3; ++i) {
      candidates[i] = std::min(candidates[i], unit[i] - 0.5f / 64);
      candidates[i + 3] = std::max(candidates[i + 3], unit[i] + 0.5f / 64);
    }
  }
  EXPECT_GT(n_candidates, 5000);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(box[i], candidates[i], 1e-6) << i;
}

// Every pixel whose ray has samples is kept, whatever the order of masks and hull; most of the others are
// not.
TEST(DropPixelsBesideHull, KeepsEveryPixelWhoseRayMeetsTheHull) {
  const TempDir dir;
  // With a focal length of 3 picture sizes the border cuts the ball.
  for (const double focal : {1.25, 3.0}) {
    const io::Scene scene = tests::BallScene(dir.path(), 12, 0, {.size = 96, .focal = focal});
    const SceneContraction contraction = SceneContraction::FromScene(scene, false);
    io::Workers workers(2);
    OccupancyGrid grid(64, contraction);
    Dataset dataset = LoadDataset(scene, 1);
    CarveByMasks(scene, dataset, contraction, &workers, &grid);
    grid.Rebuild();
    DropPixelsBesideHull(scene, contraction, grid.resolution(), &workers, &dataset);
    const std::vector<bool> used = dataset.UsedPixels();
    const Sampler sampler({.near = 0.f, .far = 10, .step_size = 0.01f}, contraction, grid);
    std::size_t n_met = 0, n_dropped = 0;
    for (std::size_t pixel = 0; pixel < dataset.n_pixels(); ++pixel) {
      const View& view = dataset.ViewOf(pixel);
      const int in_view = static_cast<int>(pixel - view.first_pixel);
      const Ray ray = view.camera.RayThrough(in_view % view.width, in_view / view.width);
      float t, t_last;
      sampler.Range(ray, &t, &t_last);
      const bool meets = MarchRay(sampler, ray, t_last, 1, &t).size() > 0;
      ASSERT_TRUE(!meets || used.empty() || used[pixel]) << pixel << " of " << view.name;
      n_met += meets;
      n_dropped += !used.empty() && !used[pixel];
    }
    EXPECT_GT(n_met, 1000u);
    if (focal < 2) {
      EXPECT_GT(n_dropped, dataset.n_pixels() / 4);
    }
  }
}

io::Mask LeftHalf() {
  io::Mask mask{20, 20, {}};
  for (int i = 0; i < 400; ++i) mask.used.push_back(i % 20 < 10 ? 255 : 0);
  return mask;
}

// Two views along +z and -z whose masks use the left half of what each sees, which is one half of the space.
TEST(CarveByFrusta, SpaceThatNoUsedPixelSeesIsEmpty) {
  const TempDir dir;
  const io::Mask left = LeftHalf();
  io::Mask right = left;
  std::reverse(right.used.begin(), right.used.end());
  io::WriteImage(dir / "a.png", io::MakeImage(20, 20, 3));
  io::WriteMask(dir / "left.png", left);
  io::WriteMask(dir / "right.png", right);
  io::Scene scene = tests::SceneOf({dir / "a.png", dir / "a.png"}, 20, 20);
  scene.frames[0].world_from_cam.translation.z() = 4;
  scene.frames[1].world_from_cam.translation.z() = -4;
  scene.frames[1].world_from_cam.rotation.diagonal() << -1, 1, -1;  // its left is the first one's right
  const SceneContraction contraction = {{0, 0, 0}, 1, false};
  io::Workers workers(2);
  const auto candidates = [&](const char* first, const char* second) {
    scene.frames[0].mask_path = *first ? dir / first : std::filesystem::path();
    scene.frames[1].mask_path = *second ? dir / second : std::filesystem::path();
    OccupancyGrid grid(64, contraction);
    CarveByFrusta(scene, LoadDataset(scene, 1), contraction, 0.1, &workers, &grid);
    int n = 0;
    for (const std::uint32_t cell : grid.Candidates()) {
      EXPECT_LT(grid.CellCentre(cell)[0], *first ? 0.5f + 1.f / 64 : 1.f);  // the masks' edge, and a cell
      ++n;
    }
    return n;
  };
  const int all = candidates("", "");
  EXPECT_GT(all, 200000);
  // Both use x < 0: half of the cells and the layer on the edge.
  EXPECT_NEAR(candidates("left.png", "right.png"), all / 2, 64 * 64 + 1);
  // One uses x < 0, the other x > 0: no more than the layers on the edge are seen twice.
  EXPECT_LE(candidates("left.png", "left.png"), 2 * 64 * 64);
}

// Two views along +z see all of the space, beyond `near`; one along -z has its nearer part closer than that,
// and uses the left half of its picture; two more look elsewhere from there. Cells that reach beyond `near`
// stay.
TEST(CarveByFrusta, SpaceNearerThanNearToAUsedPixelIsEmpty) {
  const TempDir dir;
  io::WriteImage(dir / "a.png", io::MakeImage(20, 20, 3));
  io::WriteMask(dir / "left.png", LeftHalf());
  io::Scene scene = tests::SceneOf(std::vector(5, dir / "a.png"), 20, 20);
  const Eigen::Vector3d centre(0, 0, 4);
  for (io::Frame& frame : scene.frames) frame.world_from_cam.translation = -1.5 * centre;
  for (std::size_t i = 0; i < 2; ++i) scene.frames[i].world_from_cam.rotation.diagonal() << -1, 1, -1;
  for (std::size_t i = 2; i < 5; ++i) scene.frames[i].world_from_cam.translation = centre;
  scene.frames[3].world_from_cam.rotation.diagonal() << -1, 1, -1;        // has it behind
  scene.frames[4].world_from_cam.rotation << 0, 0, -1, 0, 1, 0, 1, 0, 0;  // and beside its picture
  scene.frames[2].mask_path = dir / "left.png";
  const SceneContraction contraction = {{0, 0, 0}, 1, false};
  constexpr double kNear = 3.8;
  const double cell = 2.0 / 64, diagonal = std::sqrt(3.0) * cell;
  io::Workers workers(2);
  OccupancyGrid grid(64, contraction);
  CarveByFrusta(scene, LoadDataset(scene, 1), contraction, kNear, &workers, &grid);
  int n_near_and_unused = 0;
  for (std::uint32_t i = 0; i < grid.n_cells(); ++i) {
    Eigen::Vector3f x;
    contraction.FromUnit(grid.CellCentre(i).data(), x.data());
    const double distance = (x.cast<double>() - centre).norm();
    const bool candidate = !grid.IsDeclaredEmpty(i);
    if (x.x() < 0 && distance < kNear - 0.5 * diagonal) {
      EXPECT_FALSE(candidate) << x.transpose();
    } else if (x.head<2>().norm() < 0.5f && (x.x() > cell || distance > kNear - 0.49 * cell)) {
      EXPECT_TRUE(candidate) << x.transpose();
      n_near_and_unused += distance < kNear;
    }
  }
  EXPECT_GT(n_near_and_unused, 3000);
}

// Blocks spare cells a look at views; each cell must be decided as if every view had been asked. Cameras
// inside and outside of the inner cube look all ways, narrow enough that many blocks lie beside their
// pictures.
TEST(CarveByFrusta, BlocksDecideAsSingleCellsDo) {
  const TempDir dir;
  io::WriteImage(dir / "a.png", io::MakeImage(20, 20, 3));
  io::Scene scene = tests::SceneOf(std::vector(12, dir / "a.png"), 20, 20);
  io::Random random(7, io::Stream::kInit, 0, 0);
  for (io::Frame& frame : scene.frames) {
    Eigen::Vector<double, 7> values;
    for (double& value : values) value = 2 * random.Uniform() - 1;
    frame.world_from_cam.translation = 2.5 * values.head<3>();
    frame.world_from_cam.rotation = Eigen::Quaterniond(values.tail<4>().normalized()).toRotationMatrix();
  }
  const SceneContraction contraction = {{0, 0, 0}, 1, true};
  constexpr float kNear = 1.2f;
  io::Workers workers(2);
  OccupancyGrid grid(64, contraction);
  CarveByFrusta(scene, LoadDataset(scene, 1), contraction, kNear, &workers, &grid);
  const auto all_pixels = [](float, float) { return true; };
  std::vector<Projector> projectors;
  for (const io::Frame& frame : scene.frames) projectors.emplace_back(scene, frame);
  int n_seen = 0, n_seen_through = 0;
  for (std::uint32_t cell = 0; cell < grid.n_cells(); ++cell) {
    CellPoints points;
    CellPointsOf(grid, contraction, cell, &points);
    int seen = 0;
    bool seen_through = false;
    for (const Projector& projector : projectors) {
      seen += projector.SeesAny(points, kNear, all_pixels);
      seen_through = seen_through || projector.SeesThrough(points, kNear, all_pixels);
    }
    ASSERT_EQ(!grid.IsDeclaredEmpty(cell), seen >= 2 && !seen_through) << "cell " << cell;
    n_seen += seen >= 2;
    n_seen_through += seen >= 2 && seen_through;
  }
  EXPECT_GT(n_seen, 20000);  // neither all nor nothing
  EXPECT_LT(n_seen, 200000);
  EXPECT_GT(n_seen_through, 100);
}

}  // namespace
}  // namespace nerf
