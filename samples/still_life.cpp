// Ray tracing and light of the still life.
#include "samples/still_life.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "samples/noise.h"
#include "samples/room_paint.h"

namespace samples {
namespace {

using std::numbers::pi;
const Vec3 kLamp(2.0, -1.7, 4.2);
constexpr double kLampRadius = 0.55;  // a soft box: penumbrae of a tenth of the height of what throws them
const Vec3 kLampColour = 1.4 * Vec3(1.0, 0.95, 0.86);
const Vec3 kSkyColour = 0.4 * Vec3(0.92, 0.97, 1.0), kBounceColour = 0.24 * Vec3(1.0, 0.9, 0.78);
constexpr double kLampReference = 4.9;  // distance from lamp to table: the fall-off is 1 there
constexpr double kLegRadius = 0.2;
constexpr double kStartOffset = 2e-3;  // shadow and mirror rays leave the surface by twenty hit distances
constexpr double kFar = std::numeric_limits<double>::infinity();

Vec3 LitColour(const Vec3& albedo, const Vec3& p, const Vec3& normal, const Light& light) {
  const Vec3 to_lamp = kLamp - p;
  const double distance = to_lamp.norm();
  const double cosine = std::max(0.0, normal.dot(to_lamp) / distance);
  const double fall_off = kLampReference * kLampReference / (distance * distance);
  const Vec3 sky = Mix(kBounceColour, kSkyColour, 0.5 + 0.5 * normal.z());
  return albedo.cwiseProduct(kLampColour * (cosine * fall_off * light.lamp) + sky * light.ambient);
}

// The table top as a solid that throws a shadow on the floor.
double TableDistance(const Vec3& p) {
  const double r = std::hypot(p.x(), p.y()) - kTableRadius;
  const double h = std::abs(p.z() + 0.5 * kTableThickness) - 0.5 * kTableThickness;
  return std::min(std::max(r, h), 0.0) + std::hypot(std::max(r, 0.0), std::max(h, 0.0));
}

// Where a ray meets the side of a vertical cylinder around the z axis, from outside (near) or inside (far).
double CylinderDistance(const Vec3& origin, const Vec3& direction, double radius, bool from_inside) {
  const double a = direction.head<2>().squaredNorm(), b = origin.head<2>().dot(direction.head<2>());
  const double c = origin.head<2>().squaredNorm() - radius * radius;
  const double discriminant = b * b - a * c;
  if (discriminant < 0 || a < 1e-18) return kFar;
  const double t = (-b + (from_inside ? 1 : -1) * std::sqrt(discriminant)) / a;
  return t > 0 ? t : kFar;
}

}  // namespace

StillLife::StillLife(const StillLifeOptions& options) : seed_(options.seed), blank_(options.blank) {
  if (!blank_) {
    for (const auto& group : {FigurineSolids(), TablewareSolids()}) {
      for (const Solid& solid : group) solids_.emplace_back(solid, options.threads);
    }
    for (BakedSolid& solid : solids_) {
      solid.BakeLight([this](const Vec3& p, const Vec3& n) { return ArrivingLight(p, n); }, options.threads);
    }
  }
  PaintRoom(options);
}

double StillLife::LampVisibility(const Vec3& p) const {
  const Vec3 to_lamp = kLamp - p;
  const double length = to_lamp.norm(), spread = kLampRadius / length;
  const Vec3 direction = to_lamp / length;
  // Only what comes near the cone of light can shade: usually nothing.
  std::vector<double (*)(const Vec3&)> shading;
  for (const BakedSolid& solid : solids_) {
    const Vec3 to_centre = solid.solid().centre - p;
    const double along = std::max(0.0, to_centre.dot(direction));
    if ((to_centre - along * direction).norm() < solid.solid().radius + spread * along) {
      shading.push_back(solid.solid().distance);
    }
  }
  if (p.z() < -kTableThickness && !blank_) shading.push_back(TableDistance);
  if (shading.empty()) return 1;
  // Penumbra from the closest approach of one ray in units of the cone's radius (Quilez, "Soft shadows",
  // two-sided).
  double clearance = 1;
  for (double t = 0.01; t < length && clearance > -1;) {
    double d = kFar;
    for (const auto distance : shading) d = std::min(d, distance(p + t * direction));
    clearance = std::min(clearance, d / (spread * t));
    t += std::clamp(d, 0.01, 0.3);
  }
  clearance = std::max(clearance, -1.0);
  return 0.25 * (1 + clearance) * (1 + clearance) * (2 - clearance);
}

Light StillLife::ArrivingLight(const Vec3& p, const Vec3& normal) const {
  Light light;
  light.lamp = LampVisibility(p + kStartOffset * normal);
  // Ambient occlusion: how much closer than the walked distance the nearest thing is, along the normal (Evans
  // 2006).
  double occlusion = 0, weight = 1;
  for (int i = 1; i <= 5; ++i) {
    const double reach = 0.045 * i;
    const Vec3 q = p + reach * normal;
    double d =
        p.z() > -1e-3 ? std::max(q.z(), 0.0) + (q.head<2>().norm() > kTableRadius ? reach : 0.0) : reach;
    for (const BakedSolid& solid : solids_) {
      if ((q - solid.solid().centre).norm() < solid.solid().radius + reach)
        d = std::min(d, solid.solid().distance(q));
    }
    occlusion += weight * std::max(0.0, reach - d) / reach;
    weight *= 0.8;
  }
  light.ambient = std::max(0.15, 1 - occlusion / 3.3);
  if (p.z() < -0.5 && !blank_)
    light.ambient *= SmoothStep(-0.3, 1.6, p.head<2>().norm() - 0.5 * kTableRadius);
  return light;
}

void StillLife::PaintRoom(const StillLifeOptions& options) {
  const int threads = options.threads;
  const auto texels = [&](double n) { return std::max(16, static_cast<int>(n * options.detail)); };
  const Vec3 blank_paint = Vec3::Constant(0.55);
  // Light varies slowly: it is worked out on a grid a quarter as fine as the paint and interpolated.
  const auto paint_disc = [&](int size, double radius, double z, auto paint) {
    const auto position = [=](double u, double v) {
      return Vec3((2 * u - 1) * radius, (2 * v - 1) * radius, z);
    };
    const Texture light(size / 4, size / 4, false, threads, [&](double u, double v) {
      const Light arriving = ArrivingLight(position(u, v), Vec3::UnitZ());
      return Vec3(arriving.lamp, arriving.ambient, 0);
    });
    return std::make_unique<Texture>(size, size, false, threads, [&](double u, double v) {
      const Vec3 p = position(u, v), arriving = light.Sample(u, v, 0);
      const Vec3 albedo = blank_ ? blank_paint : paint(p.x(), p.y(), seed_);
      return LitColour(albedo, p, Vec3::UnitZ(), {arriving.x(), arriving.y()});
    });
  };
  if (!blank_) table_ = paint_disc(texels(1024), kTableRadius, 0, PaintTable);
  floor_ = paint_disc(texels(2048), kRoomRadius, kFloorZ, PaintFloor);
  wall_ = std::make_unique<Texture>(texels(4096), texels(664), true, threads, [&](double u, double v) {
    const double arc = u * 2 * pi * kRoomRadius, z = kFloorZ + v * (kCeilingZ - kFloorZ), angle = 2 * pi * u;
    const Vec3 p(kRoomRadius * std::cos(angle), kRoomRadius * std::sin(angle), z);
    const Vec3 albedo = blank_ ? blank_paint : PaintWall(arc, z, seed_);
    return LitColour(albedo, p, {-std::cos(angle), -std::sin(angle), 0}, {});
  });
}

StillLife::Hit StillLife::Trace(const Vec3& origin, const Vec3& direction) const {
  Hit hit{Thing::kWall, CylinderDistance(origin, direction, kRoomRadius, true), nullptr};
  const auto plane = [&](double z) {
    const double t = (z - origin.z()) / direction.z();
    return t > 0 ? t : kFar;
  };
  const auto offer = [&](Thing thing, double t) {
    if (t < hit.t) hit = {thing, t, nullptr};
  };
  offer(Thing::kFloor, plane(kFloorZ));
  offer(Thing::kCeiling, plane(kCeilingZ));
  if (blank_) return hit;
  const double t_table = plane(0);
  const bool on_table = (origin + t_table * direction).head<2>().norm() < kTableRadius;
  if (direction.z() < 0 && t_table < kFar && on_table) {
    offer(Thing::kTable, t_table);
  } else {
    const double t_rim = CylinderDistance(origin, direction, kTableRadius, false);
    const double z = origin.z() + t_rim * direction.z();
    if (t_rim < kFar && z < 0 && z > -kTableThickness) offer(Thing::kTableSide, t_rim);
    const double t_leg = CylinderDistance(origin, direction, kLegRadius, false);
    if (t_leg < kFar && origin.z() + t_leg * direction.z() < -kTableThickness)
      offer(Thing::kTableSide, t_leg);
  }
  for (const BakedSolid& solid : solids_) {
    const std::optional<double> t = solid.Intersect(origin, direction, hit.t);
    if (t) hit = {Thing::kSolid, *t, &solid};
  }
  return hit;
}

double StillLife::Depth(const Vec3& origin, const Vec3& direction) const {
  return Trace(origin, direction).t;
}

Vec3 StillLife::Radiance(const Vec3& origin, const Vec3& direction, double pixel_angle) const {
  return Shade(Trace(origin, direction), origin, direction, pixel_angle, true);
}

Vec3 StillLife::Shade(
    const Hit& hit, const Vec3& origin, const Vec3& direction, double pixel_angle, bool reflect) const {
  const Vec3 p = origin + hit.t * direction;
  // On a slanted plane a pixel covers more in one direction than in the other: use the geometric mean.
  const auto footprint = [&](double cosine, double height) {
    return hit.t * pixel_angle / std::sqrt(std::max(std::abs(cosine), 0.02)) / height;
  };
  const auto disc = [&](const Texture& texture, double radius) {
    return texture.Sample(
        0.5 + 0.5 * p.x() / radius, 0.5 + 0.5 * p.y() / radius, footprint(direction.z(), 2 * radius));
  };
  switch (hit.thing) {
    case Thing::kSolid:
      return ShadeSolid(hit, origin, direction, pixel_angle, reflect);
    case Thing::kTable:
      return disc(*table_, kTableRadius);
    case Thing::kFloor:
      return disc(*floor_, kRoomRadius);
    case Thing::kTableSide: {
      const Vec3 normal = Vec3(p.x(), p.y(), 0).normalized();
      const double angle = std::atan2(p.y(), p.x());
      const Vec3 wood =
          Mix(Srgb(0x4a2d1a), Srgb(0x9a6a42), FractalNoise(40 * angle, 9 * p.z(), 3, seed_ + 60));
      return LitColour(wood, p, normal, p.z() < -kTableThickness ? Light{0.1, 0.5} : Light{});
    }
    case Thing::kCeiling: {
      const double from_lamp = (p - kLamp).head<2>().norm();
      const double glow = blank_ ? 0.0 : 6 * (1 - SmoothStep(0.9 * kLampRadius, kLampRadius, from_lamp));
      return Vec3::Constant(0.55) + glow * kLampColour;
    }
    case Thing::kWall:
      break;
  }
  const double angle = std::atan2(p.y(), p.x()) / (2 * pi);
  const double height = kCeilingZ - kFloorZ, cosine = direction.dot(p) / kRoomRadius;
  return wall_->Sample(angle < 0 ? angle + 1 : angle, (p.z() - kFloorZ) / height, footprint(cosine, height));
}

Vec3 StillLife::ShadeSolid(
    const Hit& hit, const Vec3& origin, const Vec3& direction, double pixel_angle, bool reflect) const {
  const Vec3 p = origin + hit.t * direction, normal = hit.solid->Normal(p);
  const Surface surface = hit.solid->solid().surface(p, normal, seed_);
  const Light light = hit.solid->LightAt(p);
  Vec3 colour = LitColour(surface.albedo, p, normal, light);
  if (surface.gloss > 0) {  // Blinn-Phong
    constexpr double kShininess = 60;
    const Vec3 half = ((kLamp - p).normalized() - direction).normalized();
    colour += kLampColour *
              (0.35 * surface.gloss * light.lamp * std::pow(std::max(0.0, normal.dot(half)), kShininess));
  }
  if (surface.mirror > 0 && reflect) {
    const double facing = std::clamp(-direction.dot(normal), 0.0, 1.0);
    const double fresnel = surface.mirror + (1 - surface.mirror) * std::pow(1 - facing, 5);  // Schlick 1994
    const Vec3 mirrored = direction + 2 * facing * normal;
    const Vec3 start = p + kStartOffset * normal;
    // A curved glaze gathers a wide angle: about a degree of the room blurs into one pixel.
    constexpr double kMirrorAngle = 0.02;
    const Vec3 seen =
        Shade(Trace(start, mirrored), start, mirrored, std::max(pixel_angle, kMirrorAngle), false);
    colour = (1 - fresnel) * colour + fresnel * seen;
  }
  return colour;
}

}  // namespace samples
