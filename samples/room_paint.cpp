// Wood, postcards, parquet, rug, wall and the pictures on it.
#include "samples/room_paint.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "samples/noise.h"

namespace samples {
namespace {

using Vec3 = Eigen::Vector3d;
using std::numbers::pi;

int Cell(double x) { return static_cast<int>(std::floor(x)); }
double Fraction(double x) { return x - std::floor(x); }

// Boards along x with the given width: own tint, long grain, dark seams.
Vec3 Boards(double x, double y, double width, const Vec3& light, const Vec3& dark, std::uint64_t seed) {
  const int row = Cell(y / width);
  const double length = width * (5 + 4 * UnitHash(row, 1, seed));
  const double along = x / length + UnitHash(row, 2, seed);
  const std::uint64_t board = Hash(row, Cell(along), seed);
  const double warp = 0.12 * FractalNoise(2 * x, 3 * y, 2, board);
  const double grain = FractalNoise(1.5 * x, (y + warp) * 26, 4, board);
  const double pores = ValueNoise(14 * x, 160 * y, board + 9);
  Vec3 colour =
      Mix(dark, light, 0.25 * UnitHash(3, 0, board) + 0.75 * grain) * (0.8 + 0.35 * UnitHash(4, 0, board));
  colour *= 0.88 + 0.2 * pores;
  const double seam = std::min({Fraction(y / width) * width,
                                (1 - Fraction(y / width)) * width,
                                Fraction(along) * length,
                                (1 - Fraction(along)) * length});
  return colour * (0.35 + 0.65 * SmoothStep(0.002, 0.01, seam));
}

// A small picture in [0, 1] x [0, 1]; the seed chooses landscape, coloured fields or signs.
Vec3 SmallPicture(double u, double v, std::uint64_t seed) {
  const int style = static_cast<int>(Hash(1, 1, seed) % 3);
  if (style == 0) {
    const Vec3 sky = Mix(RandomColour(seed), Srgb(0xf6ead0), 0.35 + 0.65 * v);
    Vec3 colour =
        Mix(sky, Srgb(0xffffff), 0.5 * SmoothStep(0.5, 0.7, FractalNoise(5 * u, 9 * v, 4, seed + 1)));
    const double sun = std::hypot(u - 0.2 - 0.6 * UnitHash(2, 2, seed), v - 0.72);
    if (sun < 0.09) colour = Srgb(0xf4c048);
    for (unsigned hill = 0; hill < 3; ++hill) {
      const double ridge = 0.62 - 0.2 * hill + 0.3 * (FractalNoise((3 + hill) * u, hill, 4, seed + 2) - 0.5);
      if (v < ridge)
        colour = RandomColour(seed + 5 + hill) * (0.5 + 0.7 * FractalNoise(25 * u, 25 * v, 3, seed + hill));
    }
    return colour;
  }
  if (style == 1) {
    double x0 = 0, x1 = 1, y0 = 0, y1 = 1;
    std::uint64_t path = seed;
    for (int split = 0; split < 5; ++split) {  // a random binary subdivision
      const double at = 0.3 + 0.4 * UnitHash(split, 3, path);
      const bool along_x = (x1 - x0) > (y1 - y0);
      double& low = along_x ? x0 : y0;
      double& high = along_x ? x1 : y1;
      const double middle = low + at * (high - low);
      const bool above = (along_x ? u : v) > middle;
      (above ? low : high) = middle;
      path = Hash(split, above, path);
    }
    const double edge = std::min({u - x0, x1 - u, v - y0, y1 - v});
    if (edge < 0.012) return Srgb(0x201c1a);
    Vec3 colour = RandomColour(path) * (0.75 + 0.4 * FractalNoise(14 * u, 14 * v, 3, path));
    const double dot = std::hypot(u - 0.5 * (x0 + x1), v - 0.5 * (y0 + y1));
    return dot < 0.25 * std::min(x1 - x0, y1 - y0) ? RandomColour(path + 1) : colour;
  }
  const int columns = 4 + static_cast<int>(Hash(4, 4, seed) % 4);
  const double x = u * columns, y = v * columns * 0.75;
  const std::uint64_t sign = Hash(Cell(x), Cell(y), seed);
  const Vec3 paper =
      Mix(Srgb(0xf3e6cc), RandomColour(seed), 0.25) * (0.85 + 0.2 * FractalNoise(8 * u, 8 * v, 3, seed));
  return Mix(paper, 0.7 * RandomColour(sign), GlyphInk(Fraction(x), Fraction(y), sign));
}

// Ten postcards at random places on a ring around the figurine; false where there is none.
bool Postcard(double x, double y, std::uint64_t seed, Vec3* colour) {
  for (int i = 9; i >= 0; --i) {
    const double angle = 2 * pi * (i + 0.7 * UnitHash(i, 0, seed)) / 10,
                 ring = 0.72 + 0.48 * UnitHash(i, 1, seed);
    const double turn = 2 * pi * UnitHash(i, 2, seed);
    const double dx = x - ring * std::cos(angle), dy = y - ring * std::sin(angle);
    const double u = (std::cos(turn) * dx + std::sin(turn) * dy) / 0.36 + 0.5;
    const double v = (std::cos(turn) * dy - std::sin(turn) * dx) / 0.26 + 0.5;
    if (u < 0 || u > 1 || v < 0 || v > 1) continue;
    const bool border = std::min({u, 1 - u, v, 1 - v}) < 0.05;
    *colour = border ? Srgb(0xf2ecdf) : SmallPicture(u, v, Hash(i, 3, seed));
    return true;
  }
  return false;
}

// How much a few hundred fine random scratches lighten the wood at (x, y).
double Scratches(double x, double y, std::uint64_t seed) {
  constexpr double kCell = 0.2;  // at most one scratch per cell, never longer than the cell
  const int cx = Cell(x / kCell), cy = Cell(y / kCell);
  const std::uint64_t scratch = Hash(cx, cy, seed);
  const double angle = 2 * pi * UnitHash(1, 0, scratch);
  const double dx = Fraction(x / kCell) - 0.5, dy = Fraction(y / kCell) - 0.5;
  const double along = std::cos(angle) * dx + std::sin(angle) * dy,
               across = std::cos(angle) * dy - std::sin(angle) * dx;
  const double bow = across - 0.5 * (UnitHash(2, 0, scratch) - 0.5) * along * along;
  return UnitHash(4, 0, scratch) < 0.4 && std::abs(along) < 0.45 * UnitHash(3, 0, scratch)
             ? 1 - SmoothStep(0.006, 0.02, std::abs(bow))
             : 0.0;
}

}  // namespace

Vec3 PaintTable(double x, double y, std::uint64_t seed) {
  const double r = std::hypot(x, y), angle = std::atan2(y, x);
  Vec3 colour;
  if (Postcard(x, y, seed + 100, &colour)) return colour;
  if (r < 0.56) {  // the cloth: rings of signs
    constexpr double kRing = 0.08;
    const int ring = Cell(r / kRing);
    const double count = std::max(6.0, std::round(2 * pi * (ring + 0.5)));
    const double x_sign = (angle / (2 * pi) + 0.5) * count;
    const std::uint64_t sign = Hash(ring, Cell(x_sign), seed + 101);
    const Vec3 linen = Srgb(0xe9e0cf) * (0.8 + 0.3 * FractalNoise(50 * x, 50 * y, 2, seed + 102));
    const double hem = SmoothStep(0.53, 0.54, r);
    return Mix(Mix(linen, RandomColour(sign), GlyphInk(Fraction(x_sign), Fraction(r / kRing), sign)),
               Srgb(0x9a3b32),
               hem);
  }
  colour = Boards(x, y, 0.31, Srgb(0xb98353), Srgb(0x5f3a20), seed + 103);
  colour = Mix(colour, Srgb(0xd9b58a), 0.45 * Scratches(x, y, seed + 104));
  const double stain = std::hypot(x - 0.15, y - 0.98);  // a cup once stood here
  return colour * (1 - 0.4 * (1 - SmoothStep(0.004, 0.012, std::abs(stain - 0.13))));
}

Vec3 PaintFloor(double x, double y, std::uint64_t seed) {
  const double r = std::hypot(x, y), angle = std::atan2(y, x);
  if (r > 3.0) return Boards(x, y, 0.24, Srgb(0xa98a63), Srgb(0x6a4c33), seed + 110);
  const double weave = 0.75 + 0.4 * FractalNoise(22 * x, 22 * y, 3, seed + 111);
  constexpr double kBand = 0.3;
  const int band = Cell(r / kBand);
  const double count = std::max(5.0, std::round(2 * pi * (band + 0.5)));
  const double x_sign = (angle / (2 * pi) + 0.5) * count;
  const std::uint64_t sign = Hash(band, Cell(x_sign), seed + 112);
  const Vec3 ground = band % 2 ? Srgb(0x7c2f30) : Srgb(0x2f4257);
  const double ink = GlyphInk(Fraction(x_sign), Fraction(r / kBand), sign);
  const double line = SmoothStep(0.9, 0.94, Fraction(r / kBand));
  return Mix(Mix(ground, RandomColour(sign), ink), Srgb(0xd8bf8f), line) * weave;
}

Vec3 PaintWall(double arc, double z, std::uint64_t seed) {
  constexpr double kPanelTop = 0.1, pictureZ = 1.55, kSlots = 16;
  if (z < kPanelTop) {
    const Vec3 panel = Boards(z, arc, 2 * pi * kRoomRadius / 120, Srgb(0x8a9a90), Srgb(0x5d7068), seed + 120);
    return z > kPanelTop - 0.08 ? 1.3 * panel : panel;
  }
  const double slot_width = 2 * pi * kRoomRadius / kSlots;
  const int slot = Cell(arc / slot_width);
  const std::uint64_t picture = Hash(slot, 0, seed + 121);
  const double width = 1.3 + 0.4 * UnitHash(1, 0, picture), height = 1.0 + 0.8 * UnitHash(2, 0, picture);
  const double u = (Fraction(arc / slot_width) - 0.5) * slot_width / width + 0.5;
  const double v = (z - pictureZ - 0.3 * (UnitHash(3, 0, picture) - 0.5)) / height + 0.5;
  const double inset = std::min(std::min(u, 1 - u) * width, std::min(v, 1 - v) * height);
  if (inset > 0.09) return SmallPicture(u, v, picture);
  if (inset > 0.0)
    return RandomColour(picture + 1) * (0.4 + 0.8 * FractalNoise(9 * arc, 9 * z, 3, seed + 122));
  const double mottle = FractalNoise(2.2 * arc, 2.2 * z, 5, seed + 123);
  const double flecks = ValueNoise(11 * arc, 11 * z, seed + 124);
  return Mix(Srgb(0xb9ae94), Srgb(0xe2d8be), mottle) * (flecks > 0.8 ? 0.8 : 1.0);
}

}  // namespace samples
