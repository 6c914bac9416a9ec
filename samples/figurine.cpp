// The owl and its antenna: shape and paint. It looks along -y.
#include <array>
#include <numbers>

#include "samples/noise.h"
#include "samples/solid.h"

namespace samples {
namespace {

using std::numbers::pi;

enum Part { kBody, kWing, kFoot, kBeak, kEye, kEyeRing, kScarf, kPartCount };
using PartDistances = std::array<double, kPartCount>;

// Depth of the grooves carved between the rows of feathers, and how many radians of wave per unit of height.
constexpr double kCarveDepth = 0.006, kCarveWave = 2 * pi / 0.075;
// The carving ends under the scarf, where its wave crosses zero: the distance stays continuous.
constexpr double kCarveTop = 9.25 * 0.075;

double BodyDistance(const Vec3& q) {
  double d = TaperDistance(q, {0, 0, 0.34}, 0.33, {0, 0, 0.72}, 0.24);
  d = SmoothUnion(d, EllipsoidDistance(q, {0, -0.02, 0.92}, {0.3, 0.26, 0.25}), 0.08);
  d = SmoothUnion(d, TaperDistance(q, {0.16, 0, 1.06}, 0.085, {0.23, 0.02, 1.27}, 0.012), 0.06);
  d = SmoothUnion(d, TaperDistance(q, {0, 0.22, 0.25}, 0.12, {0, 0.44, 0.07}, 0.05), 0.08);
  const double carve = q.z() < kCarveTop ? kCarveDepth * std::cos(kCarveWave * q.z()) : 0.0;
  return (d + carve) / (1 + kCarveDepth * kCarveWave);
}

double FootDistance(const Vec3& q) {
  const Vec3 heel(0.14, -0.2, 0.05);
  double d = 1e9;
  for (const double spread : {-0.08, 0.0, 0.08}) {
    d = std::min(d, TaperDistance(q, heel, 0.045, {0.14 + spread, -0.38, 0.035}, 0.033));
  }
  return d;
}

double ScarfDistance(const Vec3& p) {
  const double ring = RingDistance(p, {0, 0, 0.735}, 0.235, 0.055);
  const Vec3 end = IntoFrame(p, {0.15, -0.295, 0.58}, 0.45);
  return std::min(ring, BoxDistance(end, {0.055, 0.02, 0.13}, 0.015));
}

PartDistances Parts(const Vec3& p) {
  const Vec3 q(std::abs(p.x()), p.y(), p.z());  // the owl is symmetric, its scarf is not
  PartDistances d;
  d[kBody] = BodyDistance(q);
  d[kWing] = EllipsoidDistance(q, {0.31, 0.05, 0.47}, {0.08, 0.2, 0.28});
  d[kFoot] = FootDistance(q);
  d[kBeak] = TaperDistance(q, {0, -0.26, 0.9}, 0.05, {0, -0.34, 0.79}, 0.012);
  d[kEye] = SphereDistance(q, {0.11, -0.2, 0.965}, 0.095);
  // Its axis points forward: y and z change places.
  d[kEyeRing] = RingDistance({q.x(), q.z(), q.y()}, {0.115, 0.965, -0.235}, 0.098, 0.022);
  d[kScarf] = ScarfDistance(p);
  return d;
}

double OwlDistance(const Vec3& p) {
  const PartDistances d = Parts(p);
  double result = SmoothUnion(d[kBody], d[kWing], 0.03);
  for (const Part part : {kFoot, kBeak, kEye, kEyeRing, kScarf}) result = std::min(result, d[part]);
  return result;
}

// Scale-like feathers: each cell has its own colour, a dark rim, a quill and speckles.
Vec3 FeatherPaint(
    double around, double up, double size, const Vec3& light, const Vec3& dark, std::uint64_t seed) {
  const double row = std::floor(up / size);
  const double column_shift = UnitHash(static_cast<int>(row), 0, seed);
  const double x = around / size + column_shift;
  const double fx = x - std::floor(x) - 0.5, fy = up / size - row;
  const std::uint64_t feather = Hash(static_cast<int>(std::floor(x)), static_cast<int>(row), seed);
  Vec3 colour = Mix(dark, light, UnitHash(1, 0, feather));
  if (UnitHash(2, 0, feather) < 0.3) colour = RandomColour(feather);
  const double edge = fy - 1.6 * fx * fx;
  colour *= 0.45 + 0.55 * SmoothStep(0.02, 0.16, edge);
  colour = Mix(colour,
               light,
               0.7 * (1 - SmoothStep(0.03, 0.08, std::abs(fx + 0.3 * (UnitHash(3, 0, feather) - 0.5)))));
  const double speckle = ValueNoise(around * 90, up * 90, feather);
  return colour * (0.65 + 0.6 * speckle);
}

Vec3 BodyPaint(const Vec3& p, std::uint64_t seed) {
  const double angle = std::atan2(p.x(), -p.y());
  const double around = 0.32 * angle;
  const Vec3 cream = Srgb(0xf0e0c0), brown = Srgb(0x7a4a2c), rust = Srgb(0xb5652f);
  if (p.z() > 0.72) {  // head: streaks that run out from between the eyes
    const double reach = std::hypot(p.x(), p.z() - 0.93);
    const double streak = FractalNoise(9 * angle + 3, 6 * p.z(), 3, seed + 1);
    const double spots = ValueNoise(40 * around, 40 * p.z(), seed + 2);
    const Vec3 face = Mix(cream, rust, SmoothStep(0.35, 0.65, streak));
    const Vec3 hood = Mix(brown, cream, SmoothStep(0.62, 0.74, spots));
    return Mix(face, hood, p.y() > -0.02 ? 1.0 : SmoothStep(0.2, 0.27, reach));
  }
  const bool belly = std::abs(angle) < 0.85 - 0.6 * std::abs(p.z() - 0.4);
  if (!belly) return FeatherPaint(around, p.z(), 0.075, rust, brown, seed + 3);
  // Belly: painted signs on cream.
  constexpr double kSign = 0.072;
  const double x = around / kSign, y = p.z() / kSign;
  const std::uint64_t sign = Hash(static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y)), seed + 4);
  const double ink = GlyphInk(x - std::floor(x), y - std::floor(y), sign);
  return Mix(cream * (0.8 + 0.3 * FractalNoise(30 * around, 30 * p.z(), 2, seed + 5)),
             0.6 * RandomColour(sign),
             ink);
}

Vec3 EyePaint(const Vec3& p) {
  const double r = std::hypot(std::abs(p.x()) - 0.118, p.z() - 0.965);
  return r < 0.042 ? Vec3(0.01, 0.01, 0.012) : r < 0.075 ? Srgb(0xf0a010) : Srgb(0xf6efe0);
}

Surface OwlSurface(const Vec3& p, const Vec3&, std::uint64_t seed) {
  const PartDistances d = Parts(p);
  const auto part = std::min_element(d.begin(), d.end()) - d.begin();
  const double angle = std::atan2(p.x(), -p.y());
  switch (part) {
    case kWing:
      return {FeatherPaint(
          p.y() + (p.x() > 0 ? 3 : 0), p.z() + 0.35 * p.y(), 0.09, Srgb(0xd9a566), Srgb(0x4c2f22), seed + 7)};
    case kFoot:
      return {Srgb(0xe08a2c) * (0.7 + 0.5 * ValueNoise(60 * p.x(), 60 * p.y(), seed + 8)), 0.1};
    case kBeak:
      return {Srgb(0xe8a033) * (0.8 + 0.4 * ValueNoise(70 * p.x(), 50 * p.z(), seed + 9)), 0.3};
    case kEye:
      return {EyePaint(p), 0.8, 0.04};
    case kEyeRing: {
      const double turn = std::atan2(p.z() - 0.965, std::abs(p.x()) - 0.115);
      return {Mix(Srgb(0x3c2a1e), Srgb(0xf0d9a8), ValueNoise(5 * turn + 40, p.x() > 0 ? 0 : 9, seed + 10))};
    }
    case kScarf: {
      const bool end = p.z() < 0.68;
      const int stripe = static_cast<int>(std::floor(end ? 30 * p.z() : 3.5 * (angle + 0.6 * p.z() * 6)));
      const double knit = 0.75 + 0.4 * ValueNoise(end ? 80 * p.x() : 26 * angle, 80 * p.z(), seed + 11);
      return {RandomColour(Hash(stripe, end, seed + 12)) * knit};
    }
    default:
      return {BodyPaint(p, seed)};
  }
}

// Each segment: 0.9 % of the figurine's height, about 3 pixels in a 960 pixel wide picture.
constexpr double kWireRadius = 0.0065;
const std::array<Vec3, 4> kWire = {
    Vec3(0.03, 0.05, 1.12), Vec3(0.06, 0.1, 1.34), Vec3(0.0, 0.16, 1.52), Vec3(0.13, 0.12, 1.66)};

double AntennaDistance(const Vec3& p) {
  double d = SphereDistance(p, kWire[3], 0.042);
  for (std::size_t i = 0; i + 1 < kWire.size(); ++i) {
    d = std::min(d, CapsuleDistance(p, kWire[i], kWire[i + 1], kWireRadius));
  }
  return d;
}

Surface AntennaSurface(const Vec3& p, const Vec3&, std::uint64_t seed) {
  if ((p - kWire[3]).norm() > 0.045) return {Srgb(p.z() < 1.34 ? 0x303438 : 0x9a4a20), 0.3};
  const double spots = ValueNoise(55 * p.x(), 55 * p.z(), seed + 13);
  return {Mix(Srgb(0xd03028), Srgb(0xf4e8d0), SmoothStep(0.5, 0.6, spots)), 0.5};
}

}  // namespace

std::vector<Solid> FigurineSolids() {
  return {{{0, 0, 0.62}, 0.82, OwlDistance, OwlSurface},
          {{0.07, 0.11, 1.4}, 0.36, AntennaDistance, AntennaSurface}};
}

}  // namespace samples
