// Pictures from inside of a room whose walls, floor and ceiling are covered by spots of many sizes, by any
// kind of camera.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>

#include "io/image/image.h"

namespace textured_room {

// Grey level of a place on a wall.
inline int Brightness(const Eigen::Vector3d& x) {
  double sum = 0;
  for (const double size : {0.11, 0.23, 0.5}) {
    const Eigen::Vector3d cell = (x / size).array().floor();
    const double hash = std::sin(cell.dot(Eigen::Vector3d(12.9898, 78.233, 37.719))) * 43758.5453;
    sum += hash - std::floor(hash);
  }
  return static_cast<int>(30 + 65 * sum);
}

// Where a ray from `centre` meets a wall. The room is 5 long, 5 wide and 2.4 high; y is down.
inline Eigen::Vector3d Hit(const Eigen::Vector3d& centre, const Eigen::Vector3d& ray) {
  double nearest = HUGE_VAL;
  for (int axis = 0; axis < 3; ++axis) {
    const double half = axis == 1 ? 1.2 : 2.5, to = ray[axis] > 0 ? half : -half;
    if (std::abs(ray[axis]) > 1e-9) nearest = std::min(nearest, (to - centre[axis]) / ray[axis]);
  }
  return centre + nearest * ray;
}

// ray_of: of a place in the picture [px], in the axes of the room; four per pixel are averaged.
inline io::Image Photo(int width,
                       int height,
                       const Eigen::Vector3d& centre,
                       const std::function<Eigen::Vector3d(double x, double y)>& ray_of) {
  io::Image image = io::MakeImage(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int sum = 0;
      for (int sample = 0; sample < 4; ++sample)
        sum += Brightness(Hit(centre, ray_of(x + 0.25 + 0.5 * (sample % 2), y + 0.25 + 0.5 * (sample / 2))));
      std::fill_n(image.Pixel(x, y), 3, static_cast<std::uint8_t>(sum / 4));
    }
  }
  return image;
}

}  // namespace textured_room
