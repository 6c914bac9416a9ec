// Sphere tracing (Hart 1996) that takes its long steps from the grid and its short ones from the exact
// distance.
#include "samples/baked_solid.h"

#include "io/process/parallel.h"

namespace samples {
namespace {

constexpr int kCells =
    56;  // per axis: a cell is 1 to 2 cm if the figurine is 1.3 m, about the width of a soft shadow
// A ray has arrived when it is this near: a tenth of the finest paint, a thirtieth of a pixel at arm's
// length.
constexpr double kHitDistance = 1e-4;
constexpr int kMaxSteps = 200;        // rays that graze a surface give up as missed
constexpr double kNormalStep = 4e-4;  // finite difference: well above rounding, well below the carving

}  // namespace

BakedSolid::BakedSolid(const Solid& solid, int threads) : solid_(solid), cell_(2 * solid.radius / kCells) {
  const std::size_t count = Index(0, 0, kCells + 1);
  distance_.resize(count);
  lamp_.assign(count, 1.f);
  ambient_.assign(count, 1.f);
  io::ParallelFor(static_cast<std::size_t>(kCells + 1), threads, [&](std::size_t z) {
    for (int y = 0; y <= kCells; ++y) {
      for (int x = 0; x <= kCells; ++x) {
        distance_[Index(x, y, z)] = static_cast<float>(solid_.distance(Corner() + cell_ * Vec3(x, y, z)));
      }
    }
  });
}

std::size_t BakedSolid::Index(int x, int y, int z) const {
  return static_cast<std::size_t>((std::ptrdiff_t{z} * (kCells + 1) + y) * (kCells + 1) + x);
}

void BakedSolid::BakeLight(const LightFunction& light, int threads) {
  // Light is looked up between the eight corners of the cell that a surface point lies in: none is farther
  // than this.
  const double reach = 1.74 * cell_;
  io::ParallelFor(static_cast<std::size_t>(kCells + 1), threads, [&](std::size_t z) {
    for (int y = 0; y <= kCells; ++y) {
      for (int x = 0; x <= kCells; ++x) {
        const std::size_t i = Index(x, y, z);
        const double d = distance_[i];
        if (std::abs(d) > reach) continue;
        const Vec3 corner = Corner() + cell_ * Vec3(x, y, z);
        const Vec3 normal = Normal(corner);
        // Corners inside the solid would be dark and stain the surface: they answer for the point above them.
        const Light arriving = light(corner + std::max(0.0, kHitDistance - d) * normal, normal);
        lamp_[i] = static_cast<float>(arriving.lamp);
        ambient_[i] = static_cast<float>(arriving.ambient);
      }
    }
  });
}

Light BakedSolid::LightAt(const Vec3& p) const {
  const Vec3 q = ((p - Corner()) / cell_).cwiseMax(0).cwiseMin(kCells - 1e-9);
  const int x = static_cast<int>(q.x()), y = static_cast<int>(q.y()), z = static_cast<int>(q.z());
  const Vec3 f = q - Vec3(x, y, z);
  Light light{0, 0};
  for (int corner = 0; corner < 8; ++corner) {
    const int dx = corner & 1, dy = corner >> 1 & 1, dz = corner >> 2;
    const double weight = (dx ? f.x() : 1 - f.x()) * (dy ? f.y() : 1 - f.y()) * (dz ? f.z() : 1 - f.z());
    const std::size_t i = Index(x + dx, y + dy, z + dz);
    light.lamp += weight * lamp_[i];
    light.ambient += weight * ambient_[i];
  }
  return light;
}

Vec3 BakedSolid::Normal(const Vec3& p) const {
  // Four samples on a tetrahedron instead of six along the axes (Quilez).
  Vec3 gradient = Vec3::Zero();
  for (const Vec3& k : {Vec3(1, -1, -1), Vec3(-1, -1, 1), Vec3(-1, 1, -1), Vec3(1, 1, 1)}) {
    gradient += k * solid_.distance(p + kNormalStep * k);
  }
  return gradient.normalized();
}

std::optional<double> BakedSolid::Intersect(const Vec3& origin, const Vec3& direction, double t_max) const {
  const Vec3 to_centre = solid_.centre - origin;
  const double middle = to_centre.dot(direction);
  const double half2 = solid_.radius * solid_.radius - to_centre.squaredNorm() + middle * middle;
  if (half2 <= 0) return std::nullopt;
  const double half = std::sqrt(half2), end = std::min(middle + half, t_max);
  // The distance is 1-Lipschitz: at any point of a cell it is at least that of the nearest corner less half a
  // diagonal.
  const double slack = 0.8661 * cell_;
  double t = std::max(middle - half, 0.0);
  for (int step = 0; step < kMaxSteps && t < end; ++step) {
    const Vec3 p = origin + t * direction;
    const Vec3 q = ((p - Corner()) / cell_ + Vec3::Constant(0.5)).cwiseMax(0).cwiseMin(kCells + 0.5);
    double d =
        distance_[Index(static_cast<int>(q.x()), static_cast<int>(q.y()), static_cast<int>(q.z()))] - slack;
    if (d < 0.5 * cell_) {
      d = solid_.distance(p);
      if (d < kHitDistance) return t;
    }
    t += d;
  }
  return std::nullopt;
}

}  // namespace samples
