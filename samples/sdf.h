// Signed distance functions: negative inside, and never changing faster than the distance walked
// (1-Lipschitz), which is what makes sphere tracing safe. Formulas after I. Quilez, "Distance functions"
// (iquilezles.org).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace samples {

using Vec3 = Eigen::Vector3d;

inline double SphereDistance(const Vec3& p, const Vec3& centre, double radius) {
  return (p - centre).norm() - radius;
}

// Ellipsoid with the given half axes, as a sphere in squeezed space: exact zero set, underestimated distance.
inline double EllipsoidDistance(const Vec3& p, const Vec3& centre, const Vec3& axes) {
  return ((p - centre).cwiseQuotient(axes).norm() - 1) * axes.minCoeff();
}

// Everything within `radius` of the segment a-b.
inline double CapsuleDistance(const Vec3& p, const Vec3& a, const Vec3& b, double radius) {
  const Vec3 ab = b - a, ap = p - a;
  return (ap - std::clamp(ap.dot(ab) / ab.squaredNorm(), 0.0, 1.0) * ab).norm() - radius;
}

// Segment a-b whose radius goes from ra to rb; the radius changes along the axis, so the result is scaled to
// stay 1-Lipschitz.
inline double TaperDistance(const Vec3& p, const Vec3& a, double ra, const Vec3& b, double rb) {
  const Vec3 ab = b - a, ap = p - a;
  const double length2 = ab.squaredNorm();
  const double t = std::clamp(ap.dot(ab) / length2, 0.0, 1.0);
  const double slope2 = (ra - rb) * (ra - rb) / length2;
  return ((ap - t * ab).norm() - (ra + t * (rb - ra))) / std::sqrt(1 + slope2);
}

// sqrt(x^2 + y^2); std::hypot guards against overflow that cannot happen here, and is several times slower.
inline double Length(double x, double y) { return std::sqrt(x * x + y * y); }

// Ring around the z axis through `centre`.
inline double RingDistance(const Vec3& p, const Vec3& centre, double ring_radius, double tube_radius) {
  const Vec3 q = p - centre;
  return Length(Length(q.x(), q.y()) - ring_radius, q.z()) - tube_radius;
}

// Axis-parallel box with half sizes `half`, its edges rounded with `rounding`.
inline double BoxDistance(const Vec3& p, const Vec3& half, double rounding) {
  const Vec3 q = p.cwiseAbs() - half + Vec3::Constant(rounding);
  return q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0) - rounding;
}

// Union with a fillet of about size k (polynomial smooth minimum).
inline double SmoothUnion(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - 0.25 * h * h * k;
}

// p turned by -angle about z, seen from a frame at `origin` that is itself turned by angle.
inline Vec3 IntoFrame(const Vec3& p, const Vec3& origin, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  const Vec3 q = p - origin;
  return {c * q.x() + s * q.y(), c * q.y() - s * q.x(), q.z()};
}

}  // namespace samples
