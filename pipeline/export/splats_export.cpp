#include "pipeline/export/splats_export.h"

#include <algorithm>
#include <cmath>

#include "io/base/atomic_file.h"
#include "io/scene/decomposition.h"
#include "pipeline/export/ply_bytes.h"
#include "pipeline/export/point_spacing.h"

namespace pipeline {
namespace {

// Standard deviation along the surface per spacing of the points: their sum then varies by a few per cent.
constexpr double kSigmaPerSpacing = 0.6;
// Standard deviation across the surface, as a share of the one along it.
constexpr double kFlatness = 0.1;
// Bounds of the spacing among neighbours, as shares of the footprint of a pixel or a cell there: points that
// coincide must not vanish, nor lonely ones swell.
constexpr double kMinSpacing = 0.1, kMaxSpacing = 3;
constexpr double kOpacity = 0.9;
// Of degree 0: 1 / (2 sqrt(pi)).
constexpr double kHarmonic = 0.28209479177387814;

}  // namespace

void ExportSplats(const std::vector<Surfel>& surfels,
                  const TargetFrame& target,
                  const std::filesystem::path& file) {
  std::string bytes = PlyHeader(surfels.size(),
                                "frame " + target.name + ", unit: " + target.unit,
                                {"float x",
                                 "float y",
                                 "float z",
                                 "float nx",
                                 "float ny",
                                 "float nz",
                                 "float f_dc_0",
                                 "float f_dc_1",
                                 "float f_dc_2",
                                 "float opacity",
                                 "float scale_0",
                                 "float scale_1",
                                 "float scale_2",
                                 "float rot_0",
                                 "float rot_1",
                                 "float rot_2",
                                 "float rot_3"});
  const auto put = [&](double value) { AppendBytes(static_cast<float>(value), &bytes); };
  const std::vector<double> spacing = PointSpacing(surfels);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const Surfel& surfel = surfels[i];
    const Eigen::Vector3d position = target.target_from_scene * surfel.position,
                          normal = target.target_from_scene.rotation * surfel.normal;
    const double share = std::clamp(spacing[i] / surfel.spacing, kMinSpacing, kMaxSpacing);
    const double sigma = kSigmaPerSpacing * target.target_from_scene.scale * share * surfel.spacing;
    const Eigen::Quaterniond turn(io::RotationBetween(Eigen::Vector3d::UnitZ(), normal));
    for (const double value : position) put(value);
    for (const double value : normal) put(value);
    for (const double value : surfel.rgb) put((value - 0.5) / kHarmonic);
    put(std::log(kOpacity / (1 - kOpacity)));
    for (const double value : {sigma, sigma, kFlatness * sigma}) put(std::log(value));
    for (const double value : {turn.w(), turn.x(), turn.y(), turn.z()}) put(value);
  }
  io::WriteFileAtomically(file, bytes);
}

}  // namespace pipeline
