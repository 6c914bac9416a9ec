// The march kernel of every build against its plain reference.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "io/base/random.h"
#include "nerf/kernels/kernels.h"
#include "nerf/kernels/march_reference.h"
#include "nerf/sampling/occupancy_grid.h"

namespace nerf {
namespace {

using kernels::Kernels;
using kernels::MarchIntervals;
using Sample = kernels::reference::MarchedSample<double>;

constexpr int kRays = 1003, kMaxSamples = 5;

// Rays whose starts are inside, outside and on faces of the space. All numbers are small multiples of powers
// of two, so that bounded marching is exact in float: the kernel must then agree with the reference to the
// bit.
struct March {
  explicit March(bool contracted, int n) : n_rays(n), t(static_cast<std::size_t>(n)), count(t.size(), -1) {
    const auto draw = [](std::uint64_t ray, std::uint64_t what, int low, int high, float unit) {
      return unit * static_cast<float>(
                        low + static_cast<int>(io::Random(7, io::Stream::kRay, what, ray)
                                                   .Below(static_cast<std::uint32_t>(high - low + 1))));
    };
    for (std::uint64_t r = 0; r < t.size(); ++r) {
      for (std::uint64_t i = 0; i < 3; ++i) {
        start[i].push_back(draw(r, i, -16, 48, 1.f / 32) * (contracted ? 4.f : 1.f));
        slope[i].push_back(draw(r, 3 + i, -8, 8, 1.f / 32));
      }
      t[r] = draw(r, 6, -2, 4, 0.25f);
      t_last.push_back(draw(r, 7, 0, 12, 1.f) + t[r]);  // some end where they begin
    }
    paths = {{start[0].data(), start[1].data(), start[2].data()},
             {slope[0].data(), slope[1].data(), slope[2].data()},
             t_last.data(),
             contracted};
    for (std::vector<float>* slot : {&st, &sd, &sx, &sy, &sz}) slot->resize(t.size() * kMaxSamples, -9);
    cell.resize(st.size());
  }

  void Run(const Kernels& build, const kernels::OccupancyBlocks& blocks, const MarchIntervals& intervals) {
    build.march(blocks,
                paths,
                intervals,
                n_rays,
                kMaxSamples,
                t.data(),
                count.data(),
                {st.data(), sd.data(), sx.data(), sy.data(), sz.data(), cell.data()});
  }

  // Differences beyond `tolerance` in number or values of the samples of a ray.
  bool Differs(std::size_t ray, const std::vector<Sample>& want, double want_t, double tolerance) const {
    bool differs = count[ray] != static_cast<int>(want.size()) ||
                   std::fabs(double{t[ray]} - want_t) > tolerance * (1 + std::fabs(want_t));
    for (std::size_t k = 0; k < want.size() && !differs; ++k) {
      const std::size_t i = ray * kMaxSamples + k;
      const double got[] = {double{st[i]}, double{sd[i]}, double{sx[i]}, double{sy[i]}, double{sz[i]}};
      const double exact[] = {want[k].t, want[k].delta, want[k].u[0], want[k].u[1], want[k].u[2]};
      for (int j = 0; j < 5; ++j)
        differs |= std::fabs(got[j] - exact[j]) > tolerance * (1 + std::fabs(exact[j]));
      differs |= cell[i] != want[k].cell;
    }
    return differs;
  }

  int n_rays;
  std::vector<float> start[3], slope[3], t, t_last;
  std::vector<int> count;
  std::vector<float> st, sd, sx, sy, sz;
  std::vector<std::uint32_t> cell;
  kernels::MarchPaths paths;
};

class MarchTest : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    build_ = kernels::FindKernels(GetParam());
    if (build_ == nullptr) GTEST_SKIP() << "this CPU has no " << GetParam();
    // Below a height cells are everywhere; above it rays jump, up to the longest distance.
    for (std::uint64_t i = 0; i < 9000; ++i)
      grid_.SetCandidate(io::Random(3, io::Stream::kInit, 0, i).Below(64 * 64 * 40));
    for (std::uint32_t cell = 0; cell < 64 * 64; ++cell) grid_.SetCandidate(cell);  // a wall
    grid_.Rebuild();
  }

  // Share of the rays that differ from the reference in any sample.
  double ShareThatDiffers(bool contracted, const MarchIntervals& intervals, double tolerance) {
    int n_different = 0, n_samples = 0;
    March march(contracted, kRays);
    const std::vector<float> from = march.t;
    march.Run(*build_, grid_.Blocks(), intervals);
    for (std::size_t r = 0; r < from.size(); ++r) {
      const double start[] = {
          double{march.start[0][r]}, double{march.start[1][r]}, double{march.start[2][r]}};
      const double slope[] = {
          double{march.slope[0][r]}, double{march.slope[1][r]}, double{march.slope[2][r]}};
      double t = double{from[r]};
      const std::vector<Sample> want = kernels::reference::March<double>(
          grid_.Blocks(), start, slope, contracted, intervals, double{march.t_last[r]}, kMaxSamples, &t);
      n_different += march.Differs(r, want, t, tolerance);
      n_samples += static_cast<int>(want.size());
    }
    EXPECT_GT(n_samples, 800) << "the comparison did not run";
    return n_different / static_cast<double>(kRays);
  }

  const Kernels* build_ = nullptr;
  OccupancyGrid grid_{64, SceneContraction{}};
};

TEST_P(MarchTest, BoundedRaysEqualTheReferenceToTheBit) {
  EXPECT_EQ(ShareThatDiffers(false, {.step_size = 1.f / 64, .cell_length = 1.f / 64}, 0), 0);
  EXPECT_EQ(ShareThatDiffers(false, {.step_size = 1.f / 16, .cell_length = 1.f / 32}, 0), 0);
}

// Rounding may move a sample across the border of a cell, after which a ray goes its own way.
TEST_P(MarchTest, GrowingIntervalsAndContractedSpaceEqualTheReferenceButForRounding) {
  const MarchIntervals intervals{.step_size = 1.f / 64, .cone_angle = 1.f / 100, .cell_length = 1.f / 16};
  EXPECT_LE(ShareThatDiffers(false, intervals, 2e-6), 0.02);
  EXPECT_LE(ShareThatDiffers(true, intervals, 2e-6), 0.02);
}

// A lane takes up the next ray when its own is done: no result depends on the neighbours.
TEST_P(MarchTest, RaysDoNotDependOnThoseBesideThem) {
  const MarchIntervals intervals{.step_size = 1.f / 64, .cone_angle = 1.f / 100, .cell_length = 1.f / 16};
  March all(true, kRays);
  all.Run(*build_, grid_.Blocks(), intervals);
  for (const int n : {0, 1, 7, 17, 100}) {
    March some(true, n);
    some.Run(*build_, grid_.Blocks(), intervals);
    for (std::size_t r = 0; r < static_cast<std::size_t>(n); ++r) {
      ASSERT_EQ(some.count[r], all.count[r]) << r << " of " << n;
      ASSERT_EQ(some.t[r], all.t[r]) << r << " of " << n;
      for (std::size_t i = r * kMaxSamples; i < (r + 1) * kMaxSamples; ++i) ASSERT_EQ(some.sx[i], all.sx[i]);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Builds, MarchTest, ::testing::Values("portable", "avx2", "avx512", "avx512bf16"));

}  // namespace
}  // namespace nerf
