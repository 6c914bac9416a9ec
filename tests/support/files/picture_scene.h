// A scene whose frames are given pictures, all seen by one camera at the origin.
#pragma once

#include <filesystem>
#include <vector>

#include "io/scene/scene.h"

namespace tests {

inline io::Scene SceneOf(const std::vector<std::filesystem::path>& pictures, int width, int height) {
  io::Scene scene;
  io::Camera camera;
  camera.width = width, camera.height = height;
  camera.fl_x = camera.fl_y = 1.2 * width;
  camera.cx = 0.5 * width, camera.cy = 0.5 * height;
  scene.cameras.push_back(camera);
  for (const auto& path : pictures) {
    io::Frame frame;
    frame.image_path = path;
    scene.frames.push_back(frame);
  }
  return scene;
}

}  // namespace tests
