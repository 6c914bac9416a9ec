#include "nerf/metrics/metrics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "io/base/error.h"
#include "nerf/metrics/separable_filter.h"

namespace nerf {
namespace {

constexpr double kMinMse = 1e-12;  // 10^(-kMaxPsnrDb / 10)
constexpr int kSsimRadius = 5;
constexpr double kSsimSigma = 1.5;
constexpr double kSsimC1 = 0.01 * 0.01, kSsimC2 = 0.03 * 0.03;  // (k * data range)^2

void RequireComparable(const io::Image& a, const io::Image& b) {
  const auto text = [](const io::Image& image) {
    return fmt::format("{}x{}x{}", image.width, image.height, image.channels);
  };
  if (a.width != b.width || a.height != b.height || a.channels != 3 || b.channels != 3) {
    throw io::Error(io::ExitCode::kBadInput,
                    fmt::format("pictures of {} and {} values cannot be compared", text(a), text(b)),
                    "Both must be RGB of one size");
  }
}

void RequireFitting(const io::Mask& mask, const io::Image& image) {
  if (mask.used.empty()) return;
  if (mask.width != image.width || mask.height != image.height || mask.UsedCount() == 0)
    throw io::Error(io::ExitCode::kBadInput, "a mask uses no pixel or has another size than its pictures");
}

// The centres of the windows that lie in the picture.
io::Mask CropBorder(const io::Mask& mask) {
  if (mask.used.empty()) return {};
  io::Mask centres{mask.width - 2 * kSsimRadius, mask.height - 2 * kSsimRadius, {}};
  for (int y = kSsimRadius; y < mask.height - kSsimRadius; ++y) {
    const auto row = mask.used.begin() + static_cast<std::ptrdiff_t>(y) * mask.width;
    centres.used.insert(centres.used.end(), row + kSsimRadius, row + mask.width - kSsimRadius);
  }
  return centres;
}

std::vector<double> GaussianKernel(int radius, double sigma) {
  std::vector<double> kernel;
  double sum = 0;
  for (int i = -radius; i <= radius; ++i) {
    kernel.push_back(std::exp(-i * i / (2 * sigma * sigma)));
    sum += kernel.back();
  }
  for (double& weight : kernel) weight /= sum;
  return kernel;
}

double ChannelSsim(const io::Image& a, const io::Image& b, const io::Mask& centres, std::size_t channel) {
  Plane pa(a.width, a.height), pb = pa, squares = pa, product = pa;
  for (std::size_t i = 0; i < pa.values.size(); ++i) {
    const double va = a.data[3 * i + channel] / 255.0, vb = b.data[3 * i + channel] / 255.0;
    pa.values[i] = va;
    pb.values[i] = vb;
    squares.values[i] = va * va + vb * vb;
    product.values[i] = va * vb;
  }
  const std::vector<double> kernel = GaussianKernel(kSsimRadius, kSsimSigma);
  const auto mean = [&](const Plane& plane) { return Correlate(plane, kernel, kernel, Border::kValid); };
  const Plane mean_a = mean(pa), mean_b = mean(pb), mean_squares = mean(squares),
              mean_product = mean(product);
  double sum = 0;
  std::size_t n = 0;
  for (std::size_t i = 0; i < mean_a.values.size(); ++i) {
    if (!centres.Uses(i)) continue;
    ++n;
    const double ma = mean_a.values[i], mb = mean_b.values[i];
    // Rounding may leave a variance of a flat window slightly below zero.
    const double variances = std::max(0.0, mean_squares.values[i] - ma * ma - mb * mb);
    const double covariance = mean_product.values[i] - ma * mb;
    sum += (2 * ma * mb + kSsimC1) * (2 * covariance + kSsimC2) /
           ((ma * ma + mb * mb + kSsimC1) * (variances + kSsimC2));
  }
  return sum / static_cast<double>(n);
}

}  // namespace

double MeanSquaredError(const io::Image& a, const io::Image& b, const io::Mask& mask) {
  RequireComparable(a, b);
  RequireFitting(mask, a);
  std::uint64_t sum = 0, n = 0;  // exact: 65025 per value leaves room for 10^14 values
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    if (!mask.Uses(i / 3)) continue;
    const int difference = a.data[i] - b.data[i];
    sum += static_cast<std::uint64_t>(difference * difference);
    ++n;
  }
  return static_cast<double>(sum) / (255.0 * 255.0 * static_cast<double>(n));
}

// With a the truth, b the render and g = sum(a b) / sum(b^2): sum((a - g b)^2) = sum(a^2) - sum(a b)^2 /
// sum(b^2).
double ColourAlignedError(const io::Image& truth, const io::Image& render, const io::Mask& mask) {
  RequireComparable(truth, render);
  RequireFitting(mask, truth);
  double sum = 0;
  std::size_t n = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    std::uint64_t aa = 0, bb = 0, ab = 0;
    for (std::size_t i = c; i < truth.data.size(); i += 3) {
      if (!mask.Uses(i / 3)) continue;
      const std::uint64_t a = truth.data[i], b = render.data[i];
      aa += a * a, bb += b * b, ab += a * b;
      ++n;
    }
    const double explained =
        bb > 0 ? static_cast<double>(ab) / static_cast<double>(bb) * static_cast<double>(ab) : 0;
    // Rounding may leave a perfect fit slightly below zero.
    sum += std::max(0.0, static_cast<double>(aa) - explained);
  }
  return sum / (255.0 * 255.0 * static_cast<double>(n));
}

double PsnrFromMse(double mse) { return -10.0 * std::log10(std::max(mse, kMinMse)); }

double Ssim(const io::Image& a, const io::Image& b, const io::Mask& mask) {
  RequireComparable(a, b);
  RequireFitting(mask, a);
  if (std::min(a.width, a.height) < 2 * kSsimRadius + 1) {
    throw io::Error(io::ExitCode::kBadInput,
                    fmt::format("SSIM of a picture of {}x{} pixels is not defined", a.width, a.height),
                    "Its window needs 11 pixels in each direction");
  }
  const io::Mask centres = CropBorder(mask);
  if (!centres.used.empty() && centres.UsedCount() == 0) {
    throw io::Error(io::ExitCode::kBadInput,
                    "SSIM is not defined: the mask uses only pixels at the picture's border",
                    "Its windows need 5 pixels around their centre");
  }
  return (ChannelSsim(a, b, centres, 0) + ChannelSsim(a, b, centres, 1) + ChannelSsim(a, b, centres, 2)) /
         3.0;
}

}  // namespace nerf
