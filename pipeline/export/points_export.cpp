#include "pipeline/export/points_export.h"

#include <algorithm>
#include <cmath>

#include "io/base/atomic_file.h"
#include "pipeline/export/ply_bytes.h"

namespace pipeline {

void ExportPoints(const std::vector<Surfel>& surfels,
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
                                 "uchar red",
                                 "uchar green",
                                 "uchar blue",
                                 "ushort support"});
  for (const Surfel& surfel : surfels) {
    AppendBytes(Eigen::Vector3f((target.target_from_scene * surfel.position).cast<float>()), &bytes);
    AppendBytes(Eigen::Vector3f((target.target_from_scene.rotation * surfel.normal).cast<float>()), &bytes);
    for (const double value : surfel.rgb)
      AppendBytes(static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0))), &bytes);
    AppendBytes(static_cast<std::uint16_t>(std::min(surfel.support, 65535)), &bytes);
  }
  io::WriteFileAtomically(file, bytes);
}

}  // namespace pipeline
