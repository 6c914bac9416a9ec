#include "nerf/splatting/splats.h"

namespace nerf {

kernels::SplatCamera CameraOf(const SplatView& view) {
  const io::Camera& from = view.camera;
  const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> rotation =
      io::FlipCameraAxes(view.world_from_cam).Inverse().rotation.cast<float>();
  const Eigen::Vector3f centre = view.world_from_cam.translation.cast<float>();
  kernels::SplatCamera camera{.fl_x = static_cast<float>(from.fl_x),
                              .fl_y = static_cast<float>(from.fl_y),
                              .cx = static_cast<float>(from.cx),
                              .cy = static_cast<float>(from.cy),
                              .width = static_cast<float>(from.width),
                              .height = static_cast<float>(from.height),
                              .low_pass = static_cast<float>(view.low_pass),
                              .nearest = static_cast<float>(kNearestSplat)};
  Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(camera.rotation) = rotation;
  Eigen::Map<Eigen::Vector3f>(camera.centre) = centre;
  const double margin = kSlopeMargin * from.width;
  camera.lowest_slope[0] = static_cast<float>((-from.cx - margin) / from.fl_x);
  camera.lowest_slope[1] = static_cast<float>((-from.cy - margin) / from.fl_y);
  camera.highest_slope[0] = static_cast<float>((from.width - from.cx + margin) / from.fl_x);
  camera.highest_slope[1] = static_cast<float>((from.height - from.cy + margin) / from.fl_y);
  return camera;
}

Splats SplatsWhere(const Splats& splats, const std::function<bool(const Eigen::Vector3d& middle)>& wanted) {
  Splats chosen;
  const auto copy =
      [](const std::vector<float>& from, std::size_t i, std::size_t width, std::vector<float>* to) {
        const auto row = from.begin() + static_cast<std::ptrdiff_t>(i * width);
        to->insert(to->end(), row, row + static_cast<std::ptrdiff_t>(width));
      };
  for (std::size_t i = 0; i < splats.size(); ++i) {
    if (!wanted(Eigen::Map<const Eigen::Vector3f>(&splats.places[3 * i]).cast<double>())) continue;
    copy(splats.places, i, 3, &chosen.places);
    copy(splats.log_scales, i, 3, &chosen.log_scales);
    copy(splats.rotations, i, 4, &chosen.rotations);
    copy(splats.opacities, i, 1, &chosen.opacities);
    copy(splats.colours, i, 3 * kHarmonics, &chosen.colours);
  }
  return chosen;
}

}  // namespace nerf
