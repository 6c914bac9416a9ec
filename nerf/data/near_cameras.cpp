#include "nerf/data/near_cameras.h"

#include <Eigen/Core>
#include <limits>

namespace nerf {

NearCameras::NearCameras(const io::Scene& scene,
                         const SceneContraction& contraction,
                         float reach,
                         io::Workers* workers)
    : reach_(reach), nearest_(static_cast<std::size_t>(kSide) * kSide * kSide) {
  for (const io::Frame& frame : scene.frames) {
    const Eigen::Vector3f position = frame.world_from_cam.translation.cast<float>();
    cameras_.push_back({position.x(), position.y(), position.z()});
  }
  workers->Run(kSide, [&](int z, int) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const auto centre = [](int i) { return (static_cast<float>(i) + 0.5f) / kSide; };
        const float unit[3] = {centre(x), centre(y), centre(z)};
        Eigen::Vector3f place;
        contraction.FromUnit(unit, place.data());
        float least2 = std::numeric_limits<float>::infinity();
        std::uint32_t& nearest = nearest_[static_cast<std::size_t>((z * kSide + y) * kSide + x)];
        for (std::size_t i = 0; i < cameras_.size(); ++i) {
          const float distance2 =
              (place - Eigen::Map<const Eigen::Vector3f>(cameras_[i].data())).squaredNorm();
          if (distance2 < least2) least2 = distance2, nearest = static_cast<std::uint32_t>(i);
        }
      }
    }
  });
}

}  // namespace nerf
