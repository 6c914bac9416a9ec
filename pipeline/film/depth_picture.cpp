#include "pipeline/film/depth_picture.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "io/image/colour_map.h"

namespace pipeline {

io::Image DepthPicture(const nerf::RenderedView& view, double near, double far) {
  std::vector<float> share(view.depth.size());
  for (std::size_t i = 0; i < share.size(); ++i) {
    share[i] = static_cast<float>((view.depth[i] - near) / (far - near));
  }
  io::Image picture = io::ApplyColourMap(share, view.width, view.height, io::ColourMap::kTurbo);
  for (std::size_t i = 0; i < picture.data.size(); ++i) {
    const float opacity = std::clamp(view.opacity[i / 3], 0.f, 1.f);
    picture.data[i] = static_cast<std::uint8_t>(std::lround(opacity * picture.data[i]));
  }
  return picture;
}

}  // namespace pipeline
