// Vase with twigs, bowl with fruit, books and letter cubes: shapes and paint.
#include <array>

#include "samples/noise.h"
#include "samples/solid.h"

namespace samples {
namespace {

const Vec3 kVase(-0.74, 0.44, 0);
const Vec3 kBowl(0.8, 0.42, 0.385);  // centre of the bowl's sphere
constexpr double kBowlRadius = 0.34, kBowlThickness = 0.02;

double VaseDistance(const Vec3& p) {
  const Vec3 q = p - kVase;
  double d = SphereDistance(q, {0, 0, 0.25}, 0.25);
  d = SmoothUnion(d, TaperDistance(q, {0, 0, 0.42}, 0.11, {0, 0, 0.58}, 0.08), 0.1);
  d = SmoothUnion(d, RingDistance(q, {0, 0, 0.64}, 0.09, 0.02), 0.05);
  return SmoothUnion(d, RingDistance(q, {0, 0, 0.025}, 0.13, 0.025), 0.03);
}

Surface VaseSurface(const Vec3& p, const Vec3&, std::uint64_t seed) {
  const Vec3 q = p - kVase;
  const double angle = std::atan2(q.y(), q.x()), around = 0.25 * angle;
  const Vec3 glaze = Mix(Srgb(0x123c4a), Srgb(0x2f8f8a), FractalNoise(6 * around, 5 * q.z(), 3, seed + 20));
  Vec3 colour = glaze;
  if (std::abs(q.z() - 0.27) < 0.075) {  // a band of signs
    const double x = around / 0.15, y = (q.z() - 0.195) / 0.15;
    const std::uint64_t sign = Hash(static_cast<int>(std::floor(x)), 0, seed + 21);
    colour = Mix(Srgb(0xe9dcc0), Srgb(0x9c3f2a), GlyphInk(x - std::floor(x), y, sign));
  } else if (std::abs(q.z() - 0.36) < 0.008 || std::abs(q.z() - 0.18) < 0.008 || q.z() > 0.64) {
    colour = Srgb(0xd8a848);
  }
  return {colour, 1.0, 0.06};
}

struct Twig {
  Vec3 bend, tip;  // relative to the vase
};
const std::array<Twig, 4> kTwigs = {Twig{{-0.06, 0.05, 0.9}, {-0.2, 0.16, 1.3}},
                                    Twig{{0.08, 0.02, 0.85}, {0.24, 0.06, 1.12}},
                                    Twig{{0.0, -0.08, 0.8}, {-0.05, -0.26, 1.08}},
                                    Twig{{-0.08, -0.04, 0.78}, {-0.3, -0.06, 0.98}}};
constexpr double kTwigRadius = 0.008, kBerryRadius = 0.034;

double BerryDistance(const Vec3& q) {
  double d = 1e9;
  for (const Twig& twig : kTwigs) {
    d = std::min(d, SphereDistance(q, twig.tip, kBerryRadius));
    d = std::min(d, SphereDistance(q, 0.5 * (twig.bend + twig.tip) + Vec3(0.035, 0.0, 0.01), kBerryRadius));
    d = std::min(d, SphereDistance(q, twig.bend + Vec3(-0.03, 0.02, 0.05), kBerryRadius));
  }
  return d;
}

double TwigDistance(const Vec3& p) {
  const Vec3 q = p - kVase;
  double d = BerryDistance(q);
  for (const Twig& twig : kTwigs) {
    d = std::min(d, CapsuleDistance(q, {0, 0, 0.55}, twig.bend, kTwigRadius));
    d = std::min(d, CapsuleDistance(q, twig.bend, twig.tip, kTwigRadius));
  }
  return d;
}

Surface TwigSurface(const Vec3& p, const Vec3&, std::uint64_t seed) {
  const double noise = ValueNoise(60 * p.x() + 50 * p.y(), 60 * p.z(), seed + 22);
  if (BerryDistance(p - kVase) < 2e-3) return {Mix(Srgb(0xb02a2a), Srgb(0xe8903c), noise), 0.5};
  return {Srgb(0x5a4a30) * (0.6 + 0.8 * noise), 0.0};
}

double BowlDistance(const Vec3& p) {
  const Vec3 q = p - kBowl;
  const double r = Length(q.x(), q.y());
  // Above the rim the rim is nearest, below it the shell.
  const double shell = q.z() > 0 ? Length(r - kBowlRadius, q.z()) : std::abs(Length(r, q.z()) - kBowlRadius);
  return SmoothUnion(shell - kBowlThickness, RingDistance(q, {0, 0, 0.03 - kBowl.z()}, 0.13, 0.03), 0.03);
}

Surface BowlSurface(const Vec3& p, const Vec3& normal, std::uint64_t seed) {
  const Vec3 q = p - kBowl;
  const double angle = std::atan2(q.y(), q.x()), depth = -q.z() / kBowlRadius;
  const bool inside = normal.dot(q) < 0;
  const Vec3 clay =
      Srgb(inside ? 0xe6dcc8 : 0x9fb7b0) * (0.75 + 0.4 * FractalNoise(9 * angle, 12 * depth, 3, seed + 23));
  const double x = angle * (inside ? 2.3 : 3.1), y = depth * (inside ? 3.0 : 3.6);
  const std::uint64_t cell =
      Hash(static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y)), seed + 24 + inside);
  const double ink = GlyphInk(x - std::floor(x), y - std::floor(y), cell);
  return {Mix(clay, 0.8 * RandomColour(cell), depth > 0 ? ink : 1.0), 0.25};
}

constexpr double kFruitRadius = 0.125;
Vec3 FruitCentre(int i) {
  const double angle = 0.4 + i * 2.0943951;
  return kBowl + Vec3(0.145 * std::cos(angle), 0.145 * std::sin(angle), -0.12);
}

double FruitDistance(const Vec3& p) {
  double d = SphereDistance(p, kBowl + Vec3(0.01, 0.0, 0.075), 0.11);
  for (int i = 0; i < 3; ++i) d = std::min(d, SphereDistance(p, FruitCentre(i), kFruitRadius));
  return d;
}

Surface FruitSurface(const Vec3& p, const Vec3& normal, std::uint64_t seed) {
  static const std::array<Vec3, 4> kColours = {
      Srgb(0xc23b2e), Srgb(0xe0b030), Srgb(0x7fa53a), Srgb(0xd9763a)};
  std::size_t nearest = 3;
  for (int i = 0; i < 3; ++i) {
    if (SphereDistance(p, FruitCentre(i), kFruitRadius) < 2e-3) nearest = static_cast<std::size_t>(i);
  }
  const double angle = std::atan2(normal.y(), normal.x());
  const double streak =
      FractalNoise(6 * angle + 20 * static_cast<double>(nearest), 4 * normal.z(), 3, seed + 25);
  const double speckle = ValueNoise(70 * p.x() + 90 * p.z(), 80 * p.y() + 60 * p.z(), seed + 26);
  const Vec3 skin = Mix(kColours[nearest], kColours[(nearest + 1) % 4], SmoothStep(0.45, 0.75, streak));
  return {skin * (speckle > 0.72 ? 1.5 : 0.9), 0.4, 0.02};
}

struct Block {
  Vec3 centre;
  double angle;
  Vec3 half;
  double rounding;
};
const Block kLowerBook = {{-0.55, -0.68, 0.06}, -0.35, {0.36, 0.25, 0.06}, 0.008};
const Block kUpperBook = {{-0.57, -0.66, 0.165}, 0.25, {0.27, 0.2, 0.045}, 0.008};
const Block kBigCube = {{0.52, -0.7, 0.14}, 0.35, {0.14, 0.14, 0.14}, 0.02};
const Block kSmallCube = {{0.86, -0.3, 0.11}, 0.95, {0.11, 0.11, 0.11}, 0.018};

double BlockDistance(const Vec3& p, const Block& block) {
  return BoxDistance(IntoFrame(p, block.centre, block.angle), block.half, block.rounding);
}

// Coordinates in [-1, 1] on the face that p lies on, and the face's number.
int FaceCoordinates(const Block& block, const Vec3& p, double* u, double* v) {
  const Vec3 q = IntoFrame(p, block.centre, block.angle).cwiseQuotient(block.half);
  int axis = 0;
  q.cwiseAbs().maxCoeff(&axis);
  *u = axis == 0 ? q.y() : q.x();
  *v = axis == 2 ? q.y() : q.z();
  return 2 * axis + (q[axis] > 0);
}

double BooksDistance(const Vec3& p) {
  return std::min(BlockDistance(p, kLowerBook), BlockDistance(p, kUpperBook));
}

Surface BooksSurface(const Vec3& p, const Vec3&, std::uint64_t seed) {
  const bool upper = BlockDistance(p, kUpperBook) < BlockDistance(p, kLowerBook);
  double u = 0, v = 0;
  const int face = FaceCoordinates(upper ? kUpperBook : kLowerBook, p, &u, &v);
  seed += upper ? 30 : 40;
  const Vec3 cloth = Srgb(upper ? 0x8f2f36 : 0x2c4a63);
  if (face < 4 && face != 2) {  // page edges
    return {Srgb(0xe8dfc8) * (0.6 + 0.4 * ValueNoise(6 * u + 10 * face, 25 * v, seed))};
  }
  const Vec3 weave = cloth * (0.7 + 0.6 * FractalNoise(24 * u, 18 * v, 3, seed + 1));
  if (face == 2) {  // spine: a line of signs
    const double x = 7 * u;
    return {Mix(weave,
                Srgb(0xe6c67a),
                GlyphInk(x - std::floor(x), 0.5 + 0.5 * v, Hash(static_cast<int>(std::floor(x)), 1, seed)))};
  }
  const double frame = std::max(std::abs(u), std::abs(v));
  if (frame > 0.86 && frame < 0.91) return {Srgb(0xe6c67a)};
  if (frame > 0.86) return {weave};
  const double x = 3.2 * u, y = 2.6 * v;
  const std::uint64_t cell = Hash(static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y)), seed + 2);
  return {Mix(weave, RandomColour(cell), GlyphInk(x - std::floor(x), y - std::floor(y), cell))};
}

double CubesDistance(const Vec3& p) {
  return std::min(BlockDistance(p, kBigCube), BlockDistance(p, kSmallCube));
}

Surface CubesSurface(const Vec3& p, const Vec3&, std::uint64_t seed) {
  const bool big = BlockDistance(p, kBigCube) < BlockDistance(p, kSmallCube);
  double u = 0, v = 0;
  const int face = FaceCoordinates(big ? kBigCube : kSmallCube, p, &u, &v);
  const std::uint64_t sign = Hash(face, big, seed + 50);
  const Vec3 wood = Srgb(0xe3c595) * (0.7 + 0.4 * FractalNoise(3 * u, 16 * v, 3, sign));
  const double frame = std::max(std::abs(u), std::abs(v));
  if (frame > 0.72 && frame < 0.86) return {RandomColour(sign), 0.1};
  return {Mix(wood,
              0.8 * RandomColour(sign),
              frame < 0.72 ? GlyphInk(0.5 + 0.66 * u, 0.5 + 0.66 * v, sign) : 0.0),
          0.1};
}

}  // namespace

std::vector<Solid> TablewareSolids() {
  return {{kVase + Vec3(0, 0, 0.33), 0.37, VaseDistance, VaseSurface},
          {kVase + Vec3(-0.03, -0.04, 0.94), 0.54, TwigDistance, TwigSurface},
          {kBowl + Vec3(0, 0, -0.17), 0.44, BowlDistance, BowlSurface},
          {kBowl + Vec3(0, 0, -0.07), 0.3, FruitDistance, FruitSurface},
          {{-0.55, -0.68, 0.1}, 0.46, BooksDistance, BooksSurface},
          {{0.68, -0.51, 0.13}, 0.55, CubesDistance, CubesSurface}};
}

}  // namespace samples
