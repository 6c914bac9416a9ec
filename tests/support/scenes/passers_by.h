// Things that one picture shows and the others do not, painted over pictures of a scene.
#pragma once

#include "io/image/image.h"
#include "io/scene/scene.h"

namespace tests {

// Pixels [x, x + width) x [y, y + height).
struct PasserBy {
  int x, y, width, height;
  bool Covers(int px, int py) const { return px >= x && py >= y && px < x + width && py < y + height; }
};

// As stripes that no part of a ball scene has.
inline void Paint(const PasserBy& passer_by, int picture_width, int channels, std::uint8_t* picture) {
  for (int y = passer_by.y; y < passer_by.y + passer_by.height; ++y) {
    for (int x = passer_by.x; x < passer_by.x + passer_by.width; ++x) {
      std::uint8_t* pixel = picture + channels * (y * picture_width + x);
      const bool is_red = y / 3 % 2 == 1;
      pixel[0] = is_red ? 250 : 20, pixel[1] = 10, pixel[2] = is_red ? 30 : 240;
    }
  }
}

// One in every third picture of 48 pixels a side, each at another place.
inline void PaintPassersBy(const io::Scene& scene) {
  for (std::size_t view = 0; view < scene.frames.size(); view += 3) {
    io::Image picture = io::ReadImage(scene.frames[view].image_path);
    Paint(
        {static_cast<int>(view * 11 % 36), 12, 10, 30}, picture.width, picture.channels, picture.data.data());
    io::WriteImage(scene.frames[view].image_path, picture);
  }
}

}  // namespace tests
