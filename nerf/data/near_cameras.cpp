#include "nerf/data/near_cameras.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

namespace nerf {

NearCameras::NearCameras(const io::Scene& scene,
                         const SceneContraction& contraction,
                         float reach,
                         io::Workers* workers)
    : nearness_(static_cast<std::size_t>(kSide) * kSide * kSide) {
  std::vector<Eigen::Vector3f> cameras;
  for (const io::Frame& frame : scene.frames)
    cameras.push_back(frame.world_from_cam.translation.cast<float>());
  workers->Run(kSide, [&](int z, int) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const auto centre = [](int i) { return (static_cast<float>(i) + 0.5f) / kSide; };
        const float unit[3] = {centre(x), centre(y), centre(z)};
        Eigen::Vector3f place;
        contraction.FromUnit(unit, place.data());
        float nearest2 = std::numeric_limits<float>::infinity();
        for (const Eigen::Vector3f& camera : cameras)
          nearest2 = std::min(nearest2, (place - camera).squaredNorm());
        nearness_[static_cast<std::size_t>((z * kSide + y) * kSide + x)] =
            std::max(0.f, 1 - std::sqrt(nearest2) / reach);
      }
    }
  });
}

}  // namespace nerf
