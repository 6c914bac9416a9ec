#include "sfm/bundle/camera_split.h"

namespace sfm {

CameraSplit SplitCameras(io::Scene* scene) {
  CameraSplit split;
  std::vector<io::Camera> cameras;
  std::vector<int> first(scene->cameras.size(), -1);
  for (io::Frame& frame : scene->frames) {
    const auto shared = static_cast<std::size_t>(frame.camera_index);
    frame.camera_index = static_cast<int>(cameras.size());
    cameras.push_back(scene->cameras[shared]);
    split.shared_camera.push_back(shared);
    split.lens_of.push_back(first[shared]);
    if (first[shared] < 0) first[shared] = frame.camera_index;
  }
  scene->cameras = std::move(cameras);
  return split;
}

}  // namespace sfm
