// The fast picture and its gradient against the plain one.
#include "nerf/splatting/splat_rasteriser.h"

#include <gtest/gtest.h>

#include "nerf/splatting/plain_rasteriser.h"
#include "tests/support/scenes/some_splats.h"

namespace nerf {
namespace {

std::vector<float> Before(const SplatPicture& picture, const std::array<float, 3>& background) {
  std::vector<float> rgb = picture.rgb;
  for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] += picture.transmittance[i / 3] * background[i % 3];
  return rgb;
}

constexpr int kUnevenWidth = 53, kUnevenHeight = 38;  // no whole tiles

TEST(SplatRasteriser, ShowsWhatThePlainOneShows) {
  io::Workers workers(2);
  SplatRasteriser rasteriser(&workers);
  const SplatView view = tests::SomeView(kUnevenWidth, kUnevenHeight);
  for (const std::size_t n : {0u, 1u, 700u}) {
    const Splats splats = tests::SomeSplats(n);
    const std::vector<float> fast = Before(rasteriser.Render(splats, view), {0.25f, 0.5f, 0.75f});
    const std::vector<double> plain = RenderPlainly(splats, view, {0.25, 0.5, 0.75});
    ASSERT_EQ(fast.size(), plain.size());
    double most = 0, mean = 0;
    for (std::size_t i = 0; i < fast.size(); ++i) {
      const double difference = std::abs(static_cast<double>(fast[i]) - plain[i]);
      most = std::max(most, difference), mean += difference / static_cast<double>(fast.size());
    }
    // A splat may pass the least alpha in one of them alone.
    EXPECT_LT(most, 1.5f * kernels::kMinSplatAlpha) << n;
    EXPECT_LT(mean, 1e-6) << n;
  }
}

// From a camera among them, splats of all sizes lie beside the picture, or reach into it from there; a
// low-pass of another view is in both.
TEST(SplatRasteriser, SplatsBesideThePictureAreLeftOutOnlyWhereTheyDoNotReachIt) {
  io::Workers workers(2);
  SplatRasteriser rasteriser(&workers);
  SplatView view = tests::SomeView(kUnevenWidth, kUnevenHeight);
  view.world_from_cam.translation *= 0.4;
  view.low_pass = 2;
  Splats splats = tests::SomeSplats(2000);
  for (std::size_t i = 0; i < 3 * splats.size(); i += 30) splats.log_scales[i] += 2;
  const std::vector<float> fast = Before(rasteriser.Render(splats, view), {0, 0, 0});
  const std::vector<double> plain = RenderPlainly(splats, view, {0, 0, 0});
  double mean = 0;
  for (std::size_t i = 0; i < fast.size(); ++i)
    mean += std::abs(static_cast<double>(fast[i]) - plain[i]) / static_cast<double>(fast.size());
  EXPECT_LT(mean, 1e-5);
}

// The upper and the lower half of a picture, each as a picture of its own.
TEST(SplatRasteriser, BandsOfAPictureFitTogether) {
  io::Workers workers(2);
  SplatRasteriser rasteriser(&workers);
  const SplatView view = tests::SomeView(48, 64);
  const Splats splats = tests::SomeSplats(300);
  const SplatPicture whole = rasteriser.Render(splats, view);
  std::vector<float> bands;
  for (const int begin : {0, 32}) {
    SplatView band = view;
    band.camera.height = 32;
    band.camera.cy -= begin;
    const SplatPicture part = rasteriser.Render(splats, band);
    bands.insert(bands.end(), part.rgb.begin(), part.rgb.end());
  }
  ASSERT_EQ(bands.size(), whole.rgb.size());
  for (std::size_t i = 0; i < bands.size(); ++i)
    EXPECT_NEAR(bands[i], whole.rgb[i], 1.5f * kernels::kMinSplatAlpha) << i;
}

TEST(SplatRasteriser, SplatsBehindTheCameraAreNotSeen) {
  io::Workers workers(1);
  SplatRasteriser rasteriser(&workers);
  Splats splats = tests::SomeSplats(40);
  const SplatView view = tests::SomeView(kUnevenWidth, kUnevenHeight);
  for (std::size_t i = 0; i < 40; ++i) {
    const Eigen::Vector3d place =
        view.world_from_cam * Eigen::Vector3d(0.01 * static_cast<double>(i), 0.1, i % 2 ? 1 : -0.1);
    for (int c = 0; c < 3; ++c)
      splats.places[3 * i + static_cast<std::size_t>(c)] = static_cast<float>(place[c]);
  }
  for (const float value : Before(rasteriser.Render(splats, view), {0.5f, 0.5f, 0.5f}))
    EXPECT_EQ(value, 0.5f);
  for (const double value : RenderPlainly(splats, view, {0.5, 0.5, 0.5})) EXPECT_EQ(value, 0.5);
}

// A target that is half transparent.
SplatTarget Target() {
  SplatTarget target{tests::SomeView(kUnevenWidth, kUnevenHeight), {}, {}};
  for (std::size_t i = 0; i < kUnevenWidth * kUnevenHeight; ++i) {
    for (const std::size_t value : {30u, 60u, 90u, 128u})
      target.rgba.push_back(static_cast<std::uint8_t>(value + i % 7));
  }
  return target;
}

// Wang et al. 2004, of all pixels of a block of one channel.
double Ssim(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  const auto mean = [&](auto value) {
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += value(i);
    return sum / n;
  };
  const double mx = mean([&](std::size_t i) { return x[i]; }), my = mean([&](std::size_t i) { return y[i]; });
  const double xx = mean([&](std::size_t i) { return (x[i] - mx) * (x[i] - mx); }),
               yy = mean([&](std::size_t i) { return (y[i] - my) * (y[i] - my); }),
               xy = mean([&](std::size_t i) { return (x[i] - mx) * (y[i] - my); });
  return (2 * mx * my + 1e-4) * (2 * xy + 9e-4) / ((mx * mx + my * my + 1e-4) * (xx + yy + 9e-4));
}

constexpr std::size_t kBlock = 4;  // side [px]

double PlainLoss(const Splats& splats,
                 const SplatTarget& target,
                 const std::array<double, 3>& background,
                 double structure_weight) {
  const std::vector<double> rgb = RenderPlainly(splats, target.view, background);
  std::vector<double> wanted;
  double sum = 0;
  for (std::size_t i = 0; i < rgb.size(); ++i) {
    const std::uint8_t* rgba = &target.rgba[i / 3 * 4];
    wanted.push_back(rgba[i % 3] / 255.0 + (1 - rgba[3] / 255.0) * background[i % 3]);
    sum += (rgb[i] - wanted[i]) * (rgb[i] - wanted[i]);
  }
  for (std::size_t y = 0; y + kBlock <= kUnevenHeight; y += kBlock) {
    for (std::size_t x = 0; x + kBlock <= kUnevenWidth; x += kBlock) {
      for (std::size_t c = 0; c < 3; ++c) {
        std::vector<double> a, b;
        for (std::size_t k = 0; k < kBlock * kBlock; ++k) {
          const std::size_t i = 3 * ((y + k / kBlock) * kUnevenWidth + x + k % kBlock) + c;
          a.push_back(rgb[i]), b.push_back(wanted[i]);
        }
        sum += structure_weight * static_cast<double>(kBlock * kBlock) * (1 - Ssim(a, b));
      }
    }
  }
  return sum / static_cast<double>(rgb.size());
}

class GradientTest : public testing::TestWithParam<float> {};
INSTANTIATE_TEST_SUITE_P(Structure, GradientTest, testing::Values(0.f, 0.02f));

TEST_P(GradientTest, IsThatOfThePlainLoss) {
  const auto plain_loss = [](const Splats& splats, const SplatTarget& target) {
    return PlainLoss(splats, target, {0.25, 0.5, 0.75}, GetParam());
  };
  io::Workers workers(2);
  SplatRasteriser rasteriser(&workers);
  const SplatTarget target = Target();
  Splats splats = tests::SomeSplats(30), gradient;
  // So far apart that no step below changes their order. The first one lies beyond the edge of the picture,
  // where its projection is linearised no further.
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const double depth = 2 + 0.08 * static_cast<double>(i);
    Eigen::Map<Eigen::Vector3f> place(&splats.places[3 * i]);
    const Eigen::Vector3d in_cam(i == 0 ? 1.5 : place.x(), place.y(), -depth);
    place = (target.view.world_from_cam * in_cam).cast<float>();
  }
  for (float& scale : splats.log_scales) scale += 0.85f;  // smooth over the steps below
  // At a splat's edge alpha jumps to 0, and the gradient leaves that out: opaque ones have more to set
  // against it.
  for (float& logit : splats.opacities) logit += 2.2f;
  gradient.resize(splats.size());
  const double loss =
      rasteriser.Gradient(splats, target, {0.25f, 0.5f, 0.75f}, {.structure = GetParam()}, &gradient);
  EXPECT_NEAR(loss, PlainLoss(splats, target, {0.25, 0.5, 0.75}, 0), 1e-6);

  const auto compare = [&](const char* what, auto* values, const auto& by_hand, double tolerance) {
    double squares = 0, error = 0;
    for (std::size_t i = 0; i < values->size(); ++i) {
      const float before = (*values)[i], step = 8e-3f;
      float &value = (*values)[i], high = before + step, low = before - step;
      value = high;
      const double loss_high = plain_loss(splats, target);
      value = low;
      const double loss_low = plain_loss(splats, target);
      value = before;
      const double want = (loss_high - loss_low) / (static_cast<double>(high) - static_cast<double>(low));
      squares += want * want;
      error += std::pow(static_cast<double>(by_hand[i]) - want, 2);
    }
    EXPECT_GT(squares, 0) << what;
    EXPECT_LT(std::sqrt(error / squares), tolerance) << what;
  };
  // What is left of the jump, whose height is the least alpha.
  constexpr double kEdge = 2.5 * double{kernels::kMinSplatAlpha};
  compare("places", &splats.places, gradient.places, kEdge);
  compare("scales", &splats.log_scales, gradient.log_scales, kEdge);
  compare("rotations", &splats.rotations, gradient.rotations, kEdge);
  compare("opacities", &splats.opacities, gradient.opacities, kEdge);
  compare("colours", &splats.colours, gradient.colours, 1e-3);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NE(gradient.places[c], 0);  // of the one aside
}

TEST(SplatRasteriser, UnusedPixelsAddNothing) {
  io::Workers workers(1);
  SplatRasteriser rasteriser(&workers);
  const Splats splats = tests::SomeSplats(50);
  SplatTarget target = Target();
  Splats whole, part, none;
  whole.resize(50), part.resize(50), none.resize(50);
  const double all = rasteriser.Gradient(splats, target, {0, 0, 0}, {}, &whole);
  target.used.assign(kUnevenWidth * kUnevenHeight, true);
  for (std::size_t i = 0; i < target.used.size(); i += 2) target.used[i] = false;
  const double half = rasteriser.Gradient(splats, target, {0, 0, 0}, {}, &part);
  EXPECT_NEAR(half, all / 2, 0.1 * all);
  EXPECT_NE(part.colours, whole.colours);
  target.used.assign(target.used.size(), false);
  EXPECT_EQ(rasteriser.Gradient(splats, target, {0, 0, 0}, {}, &none), 0);
  for (const float value : none.colours) EXPECT_EQ(value, 0);
}

// A wall hides half of the splats, and one lies beside the picture: their opacity costs nothing.
TEST(SplatRasteriser, OnlyTheOpacityOfSplatsThatPixelsDependOnIsPenalised) {
  io::Workers workers(1);
  SplatRasteriser rasteriser(&workers);
  const SplatTarget target = Target();
  Splats splats = tests::SomeSplats(60), without, with;
  const auto put = [&](std::size_t i, const Eigen::Vector3d& in_cam) {
    Eigen::Map<Eigen::Vector3f>(&splats.places[3 * i]) = (target.view.world_from_cam * in_cam).cast<float>();
  };
  for (std::size_t i = 0; i < splats.size(); ++i)
    put(i, {0.02 * static_cast<double>(i % 7) - 0.06, 0, i < 30 ? -2.0 : -4.0});
  put(59, {30, 0, -2});
  for (std::size_t i = 0; i < 4; ++i) {  // the wall
    put(i, {0, 0, -3 - 0.01 * static_cast<double>(i)});
    std::fill_n(&splats.log_scales[3 * i], 3, 1.f);
    splats.opacities[i] = 5;
  }
  without.resize(splats.size()), with.resize(splats.size());
  constexpr float kPenalty = 0.6f;
  rasteriser.Gradient(splats, target, {0, 0, 0}, {}, &without);
  rasteriser.Gradient(splats, target, {0, 0, 0}, {.opacity = kPenalty}, &with);
  int n_counting = 0;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const float opacity = 1 / (1 + std::exp(-splats.opacities[i]));
    const bool counts = without.opacities[i] != 0;
    EXPECT_TRUE(!counts || i < 30) << i;
    n_counting += counts;
    const float want = counts ? kPenalty / 60 * opacity * (1 - opacity) : 0;
    EXPECT_NEAR(with.opacities[i] - without.opacities[i], want, 1e-6) << i;
  }
  EXPECT_GT(n_counting, 20);
  EXPECT_EQ(with.places, without.places);
}

TEST(SplatRasteriser, ThreadsDoNotMatter) {
  const SplatTarget target = Target();
  const Splats splats = tests::SomeSplats(5000);
  Splats first;
  for (const int threads : {1, 3}) {
    io::Workers workers(threads);
    SplatRasteriser rasteriser(&workers);
    Splats gradient;
    gradient.resize(splats.size());
    rasteriser.Gradient(splats, target, {0, 0, 0}, {}, &gradient);
    if (threads == 1) first = gradient;
    EXPECT_EQ(gradient.places, first.places);
    EXPECT_EQ(gradient.colours, first.colours);
  }
}

}  // namespace
}  // namespace nerf
