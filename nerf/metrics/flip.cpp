#include "nerf/metrics/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Core>
#include <Eigen/LU>

#include "io/base/error.h"
#include "nerf/metrics/separable_filter.h"

namespace nerf {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;

// Exponents and the knee of the error redistribution, section 4 of the paper.
constexpr double kColourExponent = 0.7, kFeatureExponent = 0.5;
constexpr double kKneeAt = 0.4, kKneeError = 0.95;
// Peak-to-trough width of the eye's edge detector, in degrees.
constexpr double kFeatureWidth = 0.082;

// Contrast sensitivity in space: a sum of Gaussians a * sqrt(pi / b) * exp(-pi^2 d^2 / b), d in degrees.
struct Gaussian {
  double a, b;
};
constexpr std::array<Gaussian, 1> kAchromatic = {{{1, 0.0047}}};
constexpr std::array<Gaussian, 1> kRedGreen = {{{1, 0.0053}}};
constexpr std::array<Gaussian, 2> kBlueYellow = {{{34.1, 0.04}, {13.5, 0.025}}};
constexpr double kWidestGaussian = 0.04;

using Planes = std::array<Plane, 3>;

// Linear sRGB to CIE XYZ for D65, in the exact ratios that the primaries give.
Matrix3d XyzFromLinear() {
  Matrix3d m;
  m << 10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794,  //
      2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897,     //
      1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382;
  return m;
}

double LinearFromSrgb(double v) { return v > 0.04045 ? std::pow((v + 0.055) / 1.055, 2.4) : v / 12.92; }

// The linear opponent space YCxCz, which CIELAB becomes when its cube root is left out.
Vector3d OpponentFromXyz(const Vector3d& xyz_over_white) {
  const double x = xyz_over_white.x(), y = xyz_over_white.y(), z = xyz_over_white.z();
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

Vector3d XyzFromOpponent(const Vector3d& opponent) {
  const double y = (opponent.x() + 16) / 116;
  return {y + opponent.y() / 500, y, y - opponent.z() / 200};
}

// CIELAB with chroma scaled by lightness: the Hunt effect, colours look more vivid in bright light.
Vector3d HuntLabFromXyz(const Vector3d& xyz_over_white) {
  constexpr double kDelta = 6.0 / 29.0;
  const Vector3d f = xyz_over_white.unaryExpr([](double t) {
    return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0 / 29.0;
  });
  const double lightness = 116 * f.y() - 16, vividness = 0.01 * lightness;
  return {lightness, vividness * 500 * (f.x() - f.y()), vividness * 200 * (f.y() - f.z())};
}

// City-block in lightness, Euclidean in chroma.
double HyAb(const Vector3d& a, const Vector3d& b) {
  return std::abs(a.x() - b.x()) + std::hypot(a.y() - b.y(), a.z() - b.z());
}

Planes OpponentFromImage(const io::Image& image) {
  std::array<double, 256> linear;
  for (std::size_t v = 0; v < 256; ++v) linear[v] = LinearFromSrgb(static_cast<double>(v) / 255);
  const Matrix3d m = XyzFromLinear();
  const Matrix3d over_white = (m * Vector3d::Ones()).cwiseInverse().asDiagonal() * m;
  const Plane blank(image.width, image.height);
  Planes planes = {blank, blank, blank};
  for (std::size_t i = 0; i < blank.values.size(); ++i) {
    const std::uint8_t* p = &image.data[3 * i];
    const Vector3d opponent =
        OpponentFromXyz(over_white * Vector3d(linear[p[0]], linear[p[1]], linear[p[2]]));
    for (int c = 0; c < 3; ++c) planes[static_cast<std::size_t>(c)].values[i] = opponent[c];
  }
  return planes;
}

// Each two-dimensional Gaussian is separable; the filter is their sum divided by the sum of all its weights.
template <std::size_t N>
Plane FilterContrast(const Plane& plane, const std::array<Gaussian, N>& gaussians, double pixels_per_degree) {
  const int radius =
      static_cast<int>(std::ceil(3 * std::sqrt(kWidestGaussian / (2 * kPi * kPi)) * pixels_per_degree));
  Plane result(plane.width, plane.height);
  double total = 0;
  std::vector<Plane> parts;
  for (const Gaussian& g : gaussians) {
    std::vector<double> kernel;
    double sum = 0;
    const double amplitude = std::sqrt(g.a * std::sqrt(kPi / g.b));  // once across, once down
    for (int i = -radius; i <= radius; ++i) {
      const double degrees = i / pixels_per_degree;
      kernel.push_back(amplitude * std::exp(-kPi * kPi * degrees * degrees / g.b));
      sum += kernel.back();
    }
    total += sum * sum;
    parts.push_back(Correlate(plane, kernel, kernel, Border::kReplicate));
  }
  for (const Plane& part : parts) {
    for (std::size_t i = 0; i < part.values.size(); ++i) result.values[i] += part.values[i] / total;
  }
  return result;
}

std::vector<Vector3d> PerceivedColours(const Planes& opponent, double pixels_per_degree) {
  const Planes filtered = {FilterContrast(opponent[0], kAchromatic, pixels_per_degree),
                           FilterContrast(opponent[1], kRedGreen, pixels_per_degree),
                           FilterContrast(opponent[2], kBlueYellow, pixels_per_degree)};
  const Matrix3d m = XyzFromLinear();
  const Matrix3d over_white = (m * Vector3d::Ones()).cwiseInverse().asDiagonal() * m;
  const Matrix3d linear_from_xyz = over_white.inverse();
  std::vector<Vector3d> lab(filtered[0].values.size());
  for (std::size_t i = 0; i < lab.size(); ++i) {
    const Vector3d xyz =
        XyzFromOpponent({filtered[0].values[i], filtered[1].values[i], filtered[2].values[i]});
    // Filtering can leave the display's gamut, where CIELAB would exaggerate.
    const Vector3d linear = (linear_from_xyz * xyz).cwiseMax(0.0).cwiseMin(1.0);
    lab[i] = HuntLabFromXyz(over_white * linear);
  }
  return lab;
}

struct FeatureKernels {
  std::vector<double> gaussian, edge, point;  // point and edge: first and second derivative
};

FeatureKernels MakeFeatureKernels(double pixels_per_degree) {
  const double sigma = 0.5 * kFeatureWidth * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  FeatureKernels kernels;
  for (int i = -radius; i <= radius; ++i) {
    const double g = std::exp(-i * i / (2 * sigma * sigma));
    kernels.gaussian.push_back(g);
    kernels.edge.push_back(-i * g);
    kernels.point.push_back((i * i / (sigma * sigma) - 1) * g);
  }
  // Positive weights sum to 1, negative ones to -1, so that flat regions answer 0 and full steps about 1.
  for (std::vector<double>* kernel : {&kernels.gaussian, &kernels.edge, &kernels.point}) {
    double positive = 0, negative = 0;
    for (double w : *kernel) (w > 0 ? positive : negative) += std::abs(w);
    for (double& w : *kernel) w /= w > 0 ? positive : negative > 0 ? negative : 1.0;
  }
  return kernels;
}

// Strength of one feature at each pixel: the length of its answers across and down.
Plane FeatureStrength(const Plane& y,
                      const std::vector<double>& derivative,
                      const std::vector<double>& gaussian) {
  Plane strength = Correlate(y, derivative, gaussian, Border::kReplicate);
  const Plane down = Correlate(y, gaussian, derivative, Border::kReplicate);
  for (std::size_t i = 0; i < strength.values.size(); ++i) {
    strength.values[i] = std::hypot(strength.values[i], down.values[i]);
  }
  return strength;
}

}  // namespace

FlipMap Flip(const io::Image& a, const io::Image& b, const FlipOptions& options, const io::Mask& mask) {
  if (a.width != b.width || a.height != b.height || a.channels != 3 || b.channels != 3) {
    throw io::Error(io::ExitCode::kBadInput, "FLIP needs two RGB pictures of one size");
  }
  const std::size_t n_used = mask.used.empty() ? a.data.size() / 3 : mask.UsedCount();
  if (n_used == 0 || (!mask.used.empty() && (mask.width != a.width || mask.height != a.height)))
    throw io::Error(io::ExitCode::kBadInput, "FLIP needs a mask of the pictures' size that uses some pixel");
  const double ppd = options.pixels_per_degree;
  Planes opponent_a = OpponentFromImage(a), opponent_b = OpponentFromImage(b);
  const std::vector<Vector3d> lab_a = PerceivedColours(opponent_a, ppd),
                              lab_b = PerceivedColours(opponent_b, ppd);

  for (Planes* planes : {&opponent_a, &opponent_b}) {
    for (double& v : (*planes)[0].values) v = (v + 16) / 116;  // back to luminance in [0, 1]
  }
  const FeatureKernels k = MakeFeatureKernels(ppd);
  const Plane edge_a = FeatureStrength(opponent_a[0], k.edge, k.gaussian);
  const Plane edge_b = FeatureStrength(opponent_b[0], k.edge, k.gaussian);
  const Plane point_a = FeatureStrength(opponent_a[0], k.point, k.gaussian);
  const Plane point_b = FeatureStrength(opponent_b[0], k.point, k.gaussian);

  // The largest distance in the gamut, between green and blue, maps to an error of 1.
  const Matrix3d m = XyzFromLinear();
  const Vector3d white = m * Vector3d::Ones();
  const double largest = std::pow(
      HyAb(HuntLabFromXyz(m.col(1).cwiseQuotient(white)), HuntLabFromXyz(m.col(2).cwiseQuotient(white))),
      kColourExponent);
  const double knee = kKneeAt * largest;
  FlipMap map{a.width, a.height, std::vector<float>(lab_a.size()), 0};
  for (std::size_t i = 0; i < lab_a.size(); ++i) {
    const double distance = std::pow(HyAb(lab_a[i], lab_b[i]), kColourExponent);
    const double colour = distance < knee
                              ? kKneeError / knee * distance
                              : kKneeError + (distance - knee) / (largest - knee) * (1 - kKneeError);
    const double difference = std::max(std::abs(edge_a.values[i] - edge_b.values[i]),
                                       std::abs(point_a.values[i] - point_b.values[i]));
    const double feature = std::pow(difference / std::numbers::sqrt2, kFeatureExponent);
    const double error = std::pow(colour, 1 - feature);
    map.error[i] = static_cast<float>(error);
    if (mask.Uses(i)) map.mean += error / static_cast<double>(n_used);
  }
  return map;
}

}  // namespace nerf
