#include "nerf/splatting/surface_splats.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "io/scene/decomposition.h"
#include "nerf/splatting/point_spacing.h"

namespace nerf {
namespace {

// Standard deviation along the surface per spacing of the splats: their sum then varies by a few per cent.
constexpr double kSigmaPerSpacing = 0.6;
// Standard deviation across the surface, as a share of the one along it.
constexpr double kFlatness = 0.1;
// Bounds of the spacing among neighbours, in footprints of a pixel: splats that coincide must not vanish, nor
// lonely ones swell.
constexpr double kMinSpacing = 0.3, kMaxSpacing = 10;
// Some light passes, so that what lies behind learns from the beginning.
constexpr double kFirstOpacity = 0.5;

// Bits of a coordinate in the order of splats.
constexpr int kOrderBits = 10;

// The place on Morton's curve (1966): the bits of the coordinates, by turns. All of space is mapped to a
// cube, where the scene, which lies within a few units, has most of the room.
std::uint32_t PlaceOnCurve(const Eigen::Vector3f& position) {
  std::uint32_t place = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float x = position[axis], share = 0.5f + 0.5f * x / (1 + std::abs(x));
    const auto cell = static_cast<std::uint32_t>(share * ((1 << kOrderBits) - 1));
    for (int bit = 0; bit < kOrderBits; ++bit) place |= (cell >> bit & 1) << (3 * bit + axis);
  }
  return place;
}

// Points near to one another in space lie near to one another in memory as well.
std::vector<SurfacePoint> AlongCurve(const std::vector<SurfacePoint>& points) {
  std::vector<std::pair<std::uint32_t, std::size_t>> order;
  for (std::size_t i = 0; i < points.size(); ++i) order.push_back({PlaceOnCurve(points[i].position), i});
  std::sort(order.begin(), order.end());
  std::vector<SurfacePoint> sorted;
  for (const auto& [place, i] : order) sorted.push_back(points[i]);
  return sorted;
}

}  // namespace

Splats SplatsOn(const std::vector<SurfacePoint>& unordered) {
  const std::vector<SurfacePoint> points = AlongCurve(unordered);
  std::vector<Eigen::Vector3f> positions;
  for (const SurfacePoint& point : points) positions.push_back(point.position);
  const std::vector<double> spacing = PointSpacing(positions);
  Splats splats;
  splats.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SurfacePoint& point = points[i];
    const double footprint = point.footprint;
    const double sigma =
        kSigmaPerSpacing * std::clamp(spacing[i] / footprint, kMinSpacing, kMaxSpacing) * footprint;
    const Eigen::Quaterniond turn(io::RotationBetween(Eigen::Vector3d::UnitZ(), point.normal.cast<double>()));
    using Row = Eigen::Map<Eigen::Vector3f>;
    Row(&splats.places[3 * i]) = point.position;
    Row(&splats.log_scales[3 * i]) =
        Eigen::Vector3d(sigma, sigma, kFlatness * sigma).array().log().cast<float>();
    splats.rotations[4 * i] = static_cast<float>(turn.w());
    Row(&splats.rotations[4 * i + 1]) = turn.vec().cast<float>();
    splats.opacities[i] = static_cast<float>(std::log(kFirstOpacity / (1 - kFirstOpacity)));
    Row(&splats.colours[3 * kHarmonics * i]) =
        ((point.rgb.array().cast<double>() - 0.5) / kHarmonic0).cast<float>();
  }
  return splats;
}

}  // namespace nerf
