// A painting on a flat rectangle, kept with its smaller versions (mip levels, Williams 1983), so that one
// look-up returns the average over a pixel's footprint.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace samples {

class Texture {
 public:
  // paint(u, v) is the linear colour at u, v in [0, 1]; it is asked once per texel centre. wrap_u joins left
  // and right.
  Texture(int width,
          int height,
          bool wrap_u,
          int threads,
          const std::function<Eigen::Vector3d(double u, double v)>& paint);

  // Colour averaged over about `footprint` (a fraction of the height); trilinear.
  Eigen::Vector3d Sample(double u, double v, double footprint) const;

 private:
  struct Level {
    int width = 0, height = 0;
    std::vector<Eigen::Vector3f> texels;
  };
  Eigen::Vector3f Bilinear(const Level& level, double u, double v) const;

  bool wrap_u_;
  std::vector<Level> levels_;
};

}  // namespace samples
