// Splats that are moved away from their pictures come back to them.
#include "nerf/splatting/splat_optimizer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <limits>

#include "io/base/error.h"
#include "nerf/splatting/plain_rasteriser.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/some_splats.h"

namespace nerf {
namespace {

constexpr int kWidth = 64, kHeight = 48, kViews = 6;

SplatView ViewFrom(double angle) {
  SplatView view = tests::SomeView(kWidth, kHeight);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
  view.world_from_cam = io::Rigid3d{turn, Eigen::Vector3d::Zero()} * view.world_from_cam;
  return view;
}

std::vector<double> OverGrey(const Splats& splats, const SplatView& view) {
  return RenderPlainly(splats, view, {0.5, 0.5, 0.5});
}

std::uint8_t Byte(double value) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
}

// Its picture, with the opacity that a white background tells from a black one.
SplatTarget TargetFrom(const Splats& splats, const SplatView& view) {
  const std::vector<double> black = RenderPlainly(splats, view, {0, 0, 0}),
                            white = RenderPlainly(splats, view, {1, 1, 1});
  SplatTarget target{view, {}, {}};
  for (std::size_t i = 0; i < black.size(); i += 3) {
    for (std::size_t c = i; c < i + 3; ++c) target.rgba.push_back(Byte(black[c]));
    target.rgba.push_back(Byte(1 - (white[i] - black[i])));
  }
  return target;
}

double PsnrDb(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return -10 * std::log10(sum / static_cast<double>(a.size()));
}

class SplatOptimizer : public testing::Test {
 protected:
  SplatOptimizer() : truth_(tests::SomeSplats(150)), moved_(truth_) {
    for (int i = 0; i < kViews; ++i) targets_.push_back(TargetFrom(truth_, ViewFrom(0.4 * i)));
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      io::Random random(5, io::Stream::kSplat, 0, i);
      for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) {
        moved_.places[c] += 0.05f * (random.Uniform() - 0.5f);
        moved_.log_scales[c] += random.Uniform() - 0.5f;
      }
      moved_.opacities[i] += random.Uniform() - 0.5f;
      for (std::size_t c = 0; c < 3 * kHarmonics; ++c)
        moved_.colours[3 * kHarmonics * i + c] *= random.Uniform();
    }
  }

  const Splats truth_;
  Splats moved_;
  std::vector<SplatTarget> targets_;
};

TEST_F(SplatOptimizer, FindsTheWayBack) {
  const SplatView between = ViewFrom(0.4 * 2.5);  // that no target shows
  const double before = PsnrDb(OverGrey(moved_, between), OverGrey(truth_, between));
  double share = 0, psnr_db = 0;
  const auto follow = [&](double now, double now_db) {
    EXPECT_GT(now, share);
    share = now, psnr_db = now_db;
  };
  OptimizeSplats(targets_, {.steps = 300, .threads = 2, .progress = follow}, &moved_);
  const double after = PsnrDb(OverGrey(moved_, between), OverGrey(truth_, between));
  EXPECT_LT(before, 28);
  EXPECT_GT(after, before + 8);
  EXPECT_EQ(share, 1);
  EXPECT_GT(psnr_db, before + 8);
}

TEST_F(SplatOptimizer, SeedsMatterAndThreadsDoNot) {
  const auto fitted = [&](int threads, std::uint64_t seed) {
    Splats splats = moved_;
    OptimizeSplats(targets_, {.steps = 9, .seed = seed, .threads = threads}, &splats);
    return splats;
  };
  const Splats one = fitted(1, 0), three = fitted(3, 0);
  EXPECT_EQ(one.places, three.places);
  EXPECT_EQ(one.log_scales, three.log_scales);
  EXPECT_EQ(one.rotations, three.rotations);
  EXPECT_EQ(one.opacities, three.opacities);
  EXPECT_EQ(one.colours, three.colours);
  EXPECT_NE(one.places, fitted(1, 1).places);
}

TEST_F(SplatOptimizer, WithNothingToDoNothingChanges) {
  Splats splats = moved_;
  OptimizeSplats(targets_, {.steps = 0}, &splats);
  OptimizeSplats({}, {.steps = 5}, &splats);
  EXPECT_EQ(splats.places, moved_.places);
  Splats none;
  OptimizeSplats(targets_, {.steps = 5}, &none);
  EXPECT_EQ(none.size(), 0u);
}

TEST_F(SplatOptimizer, AnErrorThatIsNotFiniteEndsTheFit) {
  Splats splats = moved_;
  std::fill(splats.colours.begin(), splats.colours.end(), std::numeric_limits<float>::quiet_NaN());
  EXPECT_ERROR(OptimizeSplats(targets_, {.steps = 5}, &splats),
               io::ExitCode::kNumeric,
               "the error of step 0 is not finite");
}

// A small splat in the middle of pictures that are white throughout.
TEST(SplatSizes, GrowTenfoldAtMost) {
  Splats splats;
  splats.resize(1);
  splats.log_scales.assign(3, std::log(0.02f));
  splats.rotations[0] = 1;
  splats.opacities[0] = 2;
  std::fill_n(splats.colours.begin(), 3, 1.7f);
  const std::vector<std::uint8_t> white(static_cast<std::size_t>(4 * kWidth * kHeight), 255);
  OptimizeSplats({{ViewFrom(0), white, {}}, {ViewFrom(0.4), white, {}}}, {.steps = 200}, &splats);
  const float largest = *std::max_element(splats.log_scales.begin(), splats.log_scales.end());
  EXPECT_NEAR(std::exp(largest), 0.2f, 1e-4f);
}

}  // namespace
}  // namespace nerf
