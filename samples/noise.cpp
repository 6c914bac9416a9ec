// Hashes, value noise and glyphs.
#include "samples/noise.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace samples {
namespace {

std::uint64_t SplitMix(std::uint64_t z) {
  z += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

// std::floor is a library call on the oldest x86-64; noise is evaluated some 10^9 times.
std::int64_t Floor(double x) {
  const auto i = static_cast<std::int64_t>(x);
  return i - (x < static_cast<double>(i));
}

double SegmentDistance(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d ab = b - a, ap = p - a;
  return (ap - std::clamp(ap.dot(ab) / ab.squaredNorm(), 0.0, 1.0) * ab).norm();
}

}  // namespace

std::uint64_t Hash(std::int64_t x, std::int64_t y, std::uint64_t seed) {
  return SplitMix(static_cast<std::uint64_t>(x) ^ SplitMix(static_cast<std::uint64_t>(y) ^ SplitMix(seed)));
}

double UnitHash(std::int64_t x, std::int64_t y, std::uint64_t seed) {
  return static_cast<double>(Hash(x, y, seed) >> 11) * 0x1p-53;
}

double NormalHash(std::int64_t x, std::int64_t y, std::uint64_t seed) {
  const std::uint64_t bits = Hash(x, y, seed);
  const std::uint64_t sum = (bits & 0xffff) + (bits >> 16 & 0xffff) + (bits >> 32 & 0xffff) + (bits >> 48);
  constexpr double kMean = 4 * 32767.5, kDeviation = 37837.2;  // 65536 * sqrt(4 / 12)
  return (static_cast<double>(sum) - kMean) / kDeviation;
}

double ValueNoise(double x, double y, std::uint64_t seed) {
  const std::int64_t ix = Floor(x), iy = Floor(y);
  const double fx = x - static_cast<double>(ix), fy = y - static_cast<double>(iy);
  const double sx = fx * fx * (3 - 2 * fx), sy = fy * fy * (3 - 2 * fy);
  // One mixed row key serves both columns.
  const std::uint64_t row0 = SplitMix(static_cast<std::uint64_t>(iy) ^ seed * 0x9e3779b97f4a7c15u);
  const std::uint64_t row1 = SplitMix(static_cast<std::uint64_t>(iy + 1) ^ seed * 0x9e3779b97f4a7c15u);
  const auto value = [&](std::int64_t column, std::uint64_t row) {
    return static_cast<double>(SplitMix(static_cast<std::uint64_t>(column) ^ row) >> 40) * 0x1p-24;
  };
  const double v00 = value(ix, row0), v10 = value(ix + 1, row0), v01 = value(ix, row1),
               v11 = value(ix + 1, row1);
  const double top = v00 + sx * (v10 - v00), bottom = v01 + sx * (v11 - v01);
  return top + sy * (bottom - top);
}

double FractalNoise(double x, double y, int octaves, std::uint64_t seed) {
  double sum = 0, weight = 0.5, total = 0;
  for (int i = 0; i < octaves; ++i) {
    sum += weight * ValueNoise(x, y, seed + static_cast<std::uint64_t>(i));
    total += weight;
    weight *= 0.5;
    // Not exactly 2, so that the lattices of the octaves never line up.
    x = 2.03 * x + 17.1;
    y = 2.03 * y - 9.7;
  }
  return sum / total;
}

double SmoothStep(double edge0, double edge1, double x) {
  const double t = std::clamp((x - edge0) / (edge1 - edge0), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

double GlyphInk(double u, double v, std::uint64_t seed) {
  // Strokes join nodes of a 3 x 4 lattice, each starting where the last one ended, as a pen does.
  const auto node = [&](int i) {
    const std::uint64_t bits = Hash(i, 0, seed);
    return Eigen::Vector2d(0.2 + 0.3 * static_cast<double>(bits % 3),
                           0.14 + 0.24 * static_cast<double>((bits >> 8) % 4));
  };
  double distance = 1;
  Eigen::Vector2d from = node(0);
  for (int i = 1; i <= 3; ++i) {
    Eigen::Vector2d to = node(i);
    if (to == from) to.y() = from.y() > 0.5 ? 0.14 : 0.86;
    distance = std::min(distance, SegmentDistance({u, v}, from, to));
    from = to;
  }
  return 1 - SmoothStep(0.06, 0.1, distance);
}

Eigen::Vector3d Srgb(std::uint32_t rgb) {
  const auto linear = [](std::uint32_t byte) { return std::pow((byte / 255.0 + 0.055) / 1.055, 2.4); };
  return {linear(rgb >> 16 & 255), linear(rgb >> 8 & 255), linear(rgb & 255)};
}

Eigen::Vector3d RandomColour(std::uint64_t seed) {
  static const std::array<Eigen::Vector3d, 10> kPalette = {Srgb(0xc8553d),
                                                           Srgb(0xf2b05e),
                                                           Srgb(0x588b8b),
                                                           Srgb(0xe8d5b5),
                                                           Srgb(0x2d4654),
                                                           Srgb(0x93b48b),
                                                           Srgb(0x8d5b7a),
                                                           Srgb(0xd9a0a0),
                                                           Srgb(0x5470a8),
                                                           Srgb(0x4a3728)};
  return kPalette[Hash(3, 5, seed) % kPalette.size()] * (0.75 + 0.5 * UnitHash(7, 1, seed));
}

}  // namespace samples
