// Rays through the occupancy grid: nothing occupied is skipped, contraction and its speed bound hold, slabs
// are NaN-safe.
#include "nerf/sampling/sampler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "io/base/random.h"
#include "nerf/kernels/march_reference.h"
#include "tests/support/scenes/march_ray.h"

namespace nerf {
namespace {

SceneContraction Contraction(bool unbounded) { return {{0.5f, -0.25f, 0.125f}, 1.5f, unbounded}; }

Ray RandomRay(std::uint64_t seed) {
  io::Random random(seed, io::Stream::kRay, 0, 0);
  Ray ray;
  float norm = 0;
  for (int i = 0; i < 3; ++i) {
    ray.origin[i] = 6 * random.Uniform() - 3;
    ray.direction[i] = random.Uniform() - 0.5f;
    norm += ray.direction[i] * ray.direction[i];
  }
  for (float& d : ray.direction) d /= std::sqrt(norm);
  return ray;
}

TEST(SceneContraction, InverseAndCentre) {
  for (const bool unbounded : {false, true}) {
    const SceneContraction contraction = Contraction(unbounded);
    io::Random random(1, io::Stream::kInit, 0, 0);
    for (int i = 0; i < 1000; ++i) {
      float unit[3], x[3], back[3];
      for (float& u : unit) u = 0.02f + 0.96f * random.Uniform();
      contraction.FromUnit(unit, x);
      contraction.ToUnit(x, back);
      for (int j = 0; j < 3; ++j) ASSERT_NEAR(back[j], unit[j], 2e-5);
    }
    const float centre[3] = {0.5f, -0.25f, 0.125f};
    float unit[3];
    contraction.ToUnit(centre, unit);
    for (const float u : unit) EXPECT_EQ(u, 0.5f);
  }
  const float far[3] = {1e30f, -1e30f, 0};
  float unit[3];
  Contraction(true).ToUnit(far, unit);
  for (const float u : unit) EXPECT_TRUE(u >= 0 && u <= 1);
}

TEST(SceneContraction, RaysEndOnTheFacesWhateverTheirOrigin) {
  const SceneContraction contraction = Contraction(true);
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const Ray ray = RandomRay(seed);
    float end[3], far[3], x[3];
    contraction.ToUnitAtInfinity(ray.direction, end);
    for (int i = 0; i < 3; ++i) x[i] = ray.origin[i] + 1e6f * ray.direction[i];
    contraction.ToUnit(x, far);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(end[i], far[i], 1e-5) << seed;
    EXPECT_EQ(std::max({std::fabs(end[0] - 0.5f), std::fabs(end[1] - 0.5f), std::fabs(end[2] - 0.5f)}), 0.5f);
  }
}

// Against central differences of float values with steps of 1e-3: rounding is 1e-4 of a unit.
TEST(SceneContraction, GradientsArePulledBackThroughTheMap) {
  constexpr float kStep = 1e-3f, kRounding = 2e-4f;
  for (const bool unbounded : {false, true}) {
    const SceneContraction contraction = Contraction(unbounded);
    int outside = 0;
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
      io::Random random(seed, io::Stream::kInit, 3, 0);
      float x[3], d_unit[3], d_x[3];
      const float size = unbounded ? 8.f : 0.5f;
      for (float& v : x) v = size * (2 * random.Uniform() - 1);
      for (float& v : d_unit) v = 2 * random.Uniform() - 1;
      contraction.PullBack(x, d_unit, d_x);
      outside += contraction.Reach(x) > 1;
      for (int i = 0; i < 3; ++i) {
        float ahead[3] = {x[0], x[1], x[2]}, behind[3] = {x[0], x[1], x[2]}, a[3], b[3], slope = 0;
        ahead[i] += kStep, behind[i] -= kStep;
        contraction.ToUnit(ahead, a), contraction.ToUnit(behind, b);
        for (int j = 0; j < 3; ++j) slope += d_unit[j] * (a[j] - b[j]) / (2 * kStep);
        ASSERT_NEAR(d_x[i], slope, kRounding) << "seed " << seed << ", reach " << contraction.Reach(x);
      }
      SceneContraction::PullBackAtInfinity(x, d_unit, d_x);
      for (int i = 0; i < 3 && contraction.Reach(x) > 0.5f; ++i) {
        float ahead[3] = {x[0], x[1], x[2]}, behind[3] = {x[0], x[1], x[2]}, a[3], b[3], slope = 0;
        ahead[i] += kStep, behind[i] -= kStep;
        contraction.ToUnitAtInfinity(ahead, a), contraction.ToUnitAtInfinity(behind, b);
        for (int j = 0; j < 3; ++j) slope += d_unit[j] * (a[j] - b[j]) / (2 * kStep);
        ASSERT_NEAR(d_x[i], slope, 1e-2f * std::fabs(slope) + 10 * kRounding) << "seed " << seed;
      }
    }
    EXPECT_TRUE(!unbounded || outside > 100);
  }
}

TEST(SceneContraction, NoRayIsFasterThanTheBoundAndSomeReachIt) {
  const SceneContraction contraction = Contraction(true);
  const auto slack = [&](const Ray& ray, float t) {
    const float h = 1e-3f;
    float a[3], b[3], ua[3], ub[3], speed = 0;
    for (int i = 0; i < 3; ++i)
      a[i] = ray.origin[i] + t * ray.direction[i], b[i] = a[i] + h * ray.direction[i];
    contraction.ToUnit(a, ua);
    contraction.ToUnit(b, ub);
    for (int i = 0; i < 3; ++i) speed = std::max(speed, std::fabs(ub[i] - ua[i]) / h);
    const float reach = contraction.Reach(a);
    return kernels::reference::ContractedSpeed(reach, contraction.Reach(b) > reach) /
               contraction.InnerSide() -
           speed;
  };
  int outside = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const Ray ray = RandomRay(seed);
    for (float t = 0; t < 30; t += 0.25f) {
      float x[3];
      for (int i = 0; i < 3; ++i) x[i] = ray.origin[i] + t * ray.direction[i];
      ASSERT_GE(slack(ray, t), -3e-4f) << "reach " << contraction.Reach(x);
      outside += contraction.Reach(x) > 1.5f;
    }
  }
  EXPECT_GT(outside, 10000);
  // The fastest: beside an edge of the cube m = 1.25, along y and towards x = 0.
  const float m = 1.25f * contraction.half, along = 1.5f / std::sqrt(2.5f), towards = -0.5f / std::sqrt(2.5f);
  const Ray fastest = {{contraction.centre[0] + m, contraction.centre[1] + m - 0.01f, contraction.centre[2]},
                       {towards, along, 0}};
  EXPECT_NEAR(slack(fastest, -1e-3f), 0, 3e-4);
}

// A random grid with a few occupied cells; every sample that plain stepping finds, the jumping sampler finds
// too.
TEST(Sampler, JumpsNeverPassAnOccupiedCell) {
  for (const bool unbounded : {false, true}) {
    const SceneContraction contraction = Contraction(unbounded);
    OccupancyGrid grid(64, contraction);
    for (int i = 0; i < 8000; ++i)  // below half of the height: there is room above for long jumps
      grid.SetCandidate(
          io::Random(3, io::Stream::kInit, 0, static_cast<std::uint64_t>(i)).Below(64 * 64 * 32));
    grid.Rebuild();
    const SamplerOptions options{
        .near = 0.01f, .far = 40, .step_size = 0.004f, .cone_angle = unbounded ? 0.002f : 0.f};
    const Sampler sampler(options, contraction, grid);
    int hits = 0;
    for (std::uint64_t seed = 0; seed < 300; ++seed) {
      const Ray ray = RandomRay(seed);
      float first, last;
      sampler.Range(ray, &first, &last);
      std::vector<bool> found(grid.n_cells());
      float t = first;
      const Samples samples = MarchRay(sampler, ray, last, 100000, &t);
      for (const std::uint32_t cell : samples.cell) found[cell] = true;
      for (float s = first; s < last; s += 0.001f) {
        float x[3], unit[3];
        for (int i = 0; i < 3; ++i) x[i] = ray.origin[i] + s * ray.direction[i];
        contraction.ToUnit(x, unit);
        const std::uint32_t cell = grid.CellAt(unit);
        if (grid.Distance(cell) != 0 || found[cell]) continue;
        // A corner cut shorter than one interval may fall between two samples; a real crossing may not.
        float inside = 0;
        for (float u = s; u < last; u += 0.001f) {
          for (int i = 0; i < 3; ++i) x[i] = ray.origin[i] + u * ray.direction[i];
          contraction.ToUnit(x, unit);
          if (grid.CellAt(unit) != cell) break;
          inside = u - s;
        }
        ASSERT_LE(inside, 1.01f * sampler.Delta(1, s) + 0.002f)
            << "seed " << seed << " unbounded " << unbounded;
        found[cell] = true;
      }
      hits += samples.size() > 0;
    }
    EXPECT_GT(hits, 20);
  }
}

TEST(Sampler, IntervalsDoNotOverlapAndCoverAFullGrid) {
  const SceneContraction contraction = Contraction(false);
  OccupancyGrid grid(64, contraction);
  for (std::uint32_t c = 0; c < grid.n_cells(); ++c) grid.SetCandidate(c);
  grid.Rebuild();
  const Sampler sampler({.near = 0.f, .far = 100, .step_size = 0.01f}, contraction, grid);
  const Ray ray{{-5, -0.25f, 0.125f}, {1, 0, 0}};
  float t, last;
  sampler.Range(ray, &t, &last);
  EXPECT_NEAR(t, 4, 1e-5);
  EXPECT_NEAR(last, 7, 1e-5);
  const Samples samples = MarchRay(sampler, ray, last, 100000, &t);
  double length = 0;
  for (std::size_t i = 0; i < samples.delta.size(); ++i) {
    length += samples.delta[i];
    if (i > 0) {
      ASSERT_NEAR(samples.t[i] - samples.t[i - 1], samples.delta[i], 1e-5);
    }
  }
  EXPECT_NEAR(length, 3, 0.011);
}

TEST(Sampler, SlabTestSurvivesZeroComponentsAndFaces) {
  const SceneContraction contraction{{0, 0, 0}, 1, false};
  OccupancyGrid grid(64, contraction);
  const Sampler sampler({.near = 0.f, .far = 10, .step_size = 0.01f}, contraction, grid);
  const auto hits = [&](Ray ray) {
    float first, last;
    sampler.Range(ray, &first, &last);
    EXPECT_FALSE(std::isnan(first) || std::isnan(last));
    return first < last;
  };
  EXPECT_TRUE(hits({{0, 0, 0}, {0, 0, 1}}));
  EXPECT_TRUE(hits({{0, -3, 0}, {-0.f, 1, 0}}));
  EXPECT_FALSE(hits({{2, 0, 0}, {0, 0, -1}}));
  EXPECT_FALSE(hits({{0, 0, 3}, {0, 0, 1}}));
  EXPECT_TRUE(hits({{1, -3, 0}, {0, 1, 0}}));  // along a face
  EXPECT_TRUE(hits({{1e-30f, 1e-30f, -3}, {1e-38f, 0, 1}}));
}

TEST(Sampler, DegenerateRangesGiveNoSamplesAndNoNegativeLength) {
  const SceneContraction contraction{{0, 0, 0}, 1, false};
  OccupancyGrid grid(64, contraction);
  for (std::uint32_t c = 0; c < grid.n_cells(); ++c) grid.SetCandidate(c);
  grid.Rebuild();
  const auto march = [&](float near, float far, const Ray& ray) {
    const Sampler sampler({.near = near, .far = far, .step_size = 0.01f}, contraction, grid);
    float t, last;
    sampler.Range(ray, &t, &last);
    const Samples samples = MarchRay(sampler, ray, last, 100000, &t);
    for (const float delta : samples.delta) EXPECT_GT(delta, 0.f);
    for (std::size_t i = 0; i < samples.t.size(); ++i) {
      EXPECT_GE(samples.t[i], near);
      EXPECT_LE(samples.t[i], last + 0.01f);
      for (const float u : {samples.x[i], samples.y[i], samples.z[i]}) EXPECT_TRUE(u >= 0 && u <= 1);
    }
    return samples.size();
  };
  const Ray inside{{0, 0, 0}, {0, 0, 1}}, outside{{0, 0, -3}, {0, 0, 1}}, away{{0, 0, 3}, {0, 0, 1}};
  for (const Ray& ray : {inside, outside, away}) {
    EXPECT_EQ(march(2.5f, 2.5f, ray), 0);
    EXPECT_EQ(march(5, 1, ray), 0);
  }
  constexpr float kInf = std::numeric_limits<float>::infinity();
  EXPECT_NEAR(march(0, kInf, inside), 100, 1);
  EXPECT_NEAR(march(0, kInf, outside), 200, 1);
  EXPECT_EQ(march(0, kInf, away), 0);
  EXPECT_NEAR(march(-0.5f, 6, inside), 150, 1);  // the caller's choice: also what lies behind the camera
}

TEST(OccupancyGrid, DistancesEqualBruteForce) {
  const SceneContraction contraction = Contraction(false);
  OccupancyGrid grid(64, contraction);
  std::vector<std::array<int, 3>> occupied;
  for (std::uint64_t i = 0; i < 12; ++i) {
    const std::uint32_t cell = io::Random(5, io::Stream::kInit, 0, i).Below(64 * 64 * 64);
    grid.SetCandidate(cell);
    occupied.push_back(
        {static_cast<int>(cell % 64), static_cast<int>(cell / 64 % 64), static_cast<int>(cell / 4096)});
  }
  grid.Rebuild();
  for (std::uint32_t cell = 0; cell < grid.n_cells(); cell += 7) {
    int nearest = 24;
    for (const auto& o : occupied) {
      const int dx = std::abs(o[0] - static_cast<int>(cell % 64)),
                dy = std::abs(o[1] - static_cast<int>(cell / 64 % 64));
      nearest = std::min(nearest, std::max({dx, dy, std::abs(o[2] - static_cast<int>(cell / 4096))}));
    }
    ASSERT_EQ(grid.Distance(cell), nearest) << cell;
    const std::uint32_t x = cell % 64, y = cell / 64 % 64, z = cell / 4096;
    const std::uint32_t block = (z / 4 * 16 + y / 4) * 16 + x / 4, bit = (z % 4 * 4 + y % 4) * 4 + x % 4;
    const kernels::OccupancyBlocks blocks = grid.Blocks();
    ASSERT_LE(blocks.distance[block], nearest) << cell;
    ASSERT_EQ(blocks.cells[block] >> bit & 1, nearest == 0) << cell;
    ASSERT_EQ(blocks.distance[block] == 0, blocks.cells[block] != 0) << cell;
  }
}

TEST(OccupancyGrid, VisitsPruneAndProbesRevive) {
  const SceneContraction contraction = Contraction(false);
  OccupancyGrid grid(64, contraction);
  grid.SetCandidate(1000);
  grid.Rebuild();
  EXPECT_EQ(grid.Distance(1000), 0);
  for (int i = 0; i < 30; ++i) grid.Visit(1000, 0.f);
  grid.Rebuild();
  EXPECT_NE(grid.Distance(1000), 0);
  grid.Probe(1000, 2 * grid.Threshold(1000));
  grid.Rebuild();
  EXPECT_EQ(grid.Distance(1000), 0);
}

TEST(OccupancyGrid, SettledSpaceStaysEmptyButForTheNeighboursOfWhatIsOccupied) {
  OccupancyGrid grid(64, Contraction(true));
  const std::uint32_t occupied = (32 * 64 + 32) * 64 + 32, neighbour = occupied + 64 + 1, far = occupied + 2;
  for (const std::uint32_t cell : {occupied, neighbour, far}) grid.SetCandidate(cell);
  for (const std::uint32_t cell : {neighbour, far}) {
    for (int i = 0; i < 30; ++i) grid.Visit(cell, 0.f);
  }
  grid.Rebuild();
  grid.Settle();
  EXPECT_FALSE(grid.IsDeclaredEmpty(occupied));
  EXPECT_FALSE(grid.IsDeclaredEmpty(neighbour));
  EXPECT_TRUE(grid.IsDeclaredEmpty(far));
  const std::vector<std::uint32_t> candidates = grid.Candidates();
  EXPECT_EQ(candidates.size(), 27u);  // a block of 3 x 3 x 3 cells
}

TEST(OccupancyGrid, SurfacesGrowIntoWhatWasPresumedEmptyButNotIntoWhatIs) {
  OccupancyGrid grid(64, Contraction(true));
  const std::uint32_t first = (32 * 64 + 32) * 64 + 20, last = first + 3;  // a row of cells
  grid.SetCandidate(first);
  for (std::uint32_t cell = first + 1; cell <= last; ++cell) grid.PresumeEmpty(cell);
  grid.SetEmpty(first - 1);
  grid.PresumeEmpty(first - 1);
  grid.Rebuild();
  for (std::uint32_t cell = first; cell < last; ++cell) {
    EXPECT_TRUE(grid.IsDeclaredEmpty(cell + 1));
    grid.Settle();
    EXPECT_FALSE(grid.IsDeclaredEmpty(cell + 1));
    grid.Probe(cell + 1, 2 * grid.Threshold(cell + 1));
    grid.Rebuild();
    EXPECT_EQ(grid.Distance(cell + 1), 0);
  }
  EXPECT_TRUE(grid.IsDeclaredEmpty(first - 1));
}

}  // namespace
}  // namespace nerf
