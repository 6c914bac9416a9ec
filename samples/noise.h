// Counter-based randomness: every value is a pure function of integer coordinates and a seed, so that results
// do not depend on the order of evaluation. Also the paint strokes that are made of it.
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace samples {

// Well-mixed 64 bits of (x, y, seed): the finaliser of SplitMix64 (Steele et al., OOPSLA 2014) applied three
// times.
std::uint64_t Hash(std::int64_t x, std::int64_t y, std::uint64_t seed);

// Uniform in [0, 1).
double UnitHash(std::int64_t x, std::int64_t y, std::uint64_t seed);

// Mean 0, variance 1: the sum of four uniforms (Irwin-Hall), bounded by 3.47.
double NormalHash(std::int64_t x, std::int64_t y, std::uint64_t seed);

// Value noise in [0, 1] with features of size 1, continuous with its gradient.
double ValueNoise(double x, double y, std::uint64_t seed);

// Fractal sum of `octaves` value noises in [0, 1]; each has half the size and half the strength of the one
// before.
double FractalNoise(double x, double y, int octaves, std::uint64_t seed);

// 0 below `edge0`, 1 above `edge1`, smooth in between.
double SmoothStep(double edge0, double edge1, double x);

// Ink in [0, 1] of a letter-like sign of three random strokes in the unit square; no two seeds look alike.
double GlyphInk(double u, double v, std::uint64_t seed);

// Linear-light colour of an sRGB value 0xRRGGBB.
Eigen::Vector3d Srgb(std::uint32_t rgb);

// A clear pleasant colour in linear light; hue drawn by the seed.
Eigen::Vector3d RandomColour(std::uint64_t seed);

// (1 - t) * a + t * b.
inline Eigen::Vector3d Mix(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double t) {
  return a + t * (b - a);
}

}  // namespace samples
