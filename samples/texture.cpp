// Mip-mapped look-up.
#include "samples/texture.h"

#include <algorithm>
#include <cmath>

#include "io/process/parallel.h"

namespace samples {

Texture::Texture(int width,
                 int height,
                 bool wrap_u,
                 int threads,
                 const std::function<Eigen::Vector3d(double u, double v)>& paint)
    : wrap_u_(wrap_u) {
  Level base{
      width, height, std::vector<Eigen::Vector3f>(static_cast<std::size_t>(std::ptrdiff_t{width} * height))};
  io::ParallelFor(static_cast<std::size_t>(height), threads, [&](std::size_t y) {
    Eigen::Vector3f* row = &base.texels[y * static_cast<std::size_t>(width)];
    for (int x = 0; x < width; ++x) {
      row[x] = paint((x + 0.5) / width, (y + 0.5) / height).cast<float>();
    }
  });
  levels_.push_back(std::move(base));
  while (levels_.back().width > 1 && levels_.back().height > 1) {
    const Level& fine = levels_.back();
    Level coarse{fine.width / 2, fine.height / 2, {}};
    coarse.texels.resize(static_cast<std::size_t>(std::ptrdiff_t{coarse.width} * coarse.height));
    for (int y = 0; y < coarse.height; ++y) {
      Eigen::Vector3f* row = &coarse.texels[static_cast<std::size_t>(std::ptrdiff_t{y} * coarse.width)];
      const Eigen::Vector3f* row0 =
          &fine.texels[static_cast<std::size_t>(std::ptrdiff_t{2} * y * fine.width)];
      const Eigen::Vector3f* row1 = row0 + fine.width;
      for (int x = 0; x < coarse.width; ++x, row0 += 2, row1 += 2) {
        row[x] = 0.25f * (row0[0] + row0[1] + row1[0] + row1[1]);
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

Eigen::Vector3f Texture::Bilinear(const Level& level, double u, double v) const {
  const double x = u * level.width - 0.5 + level.width,
               y = std::clamp(v * level.height - 0.5, 0.0, level.height - 1.0);
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);  // x is shifted by one width: never negative
  const auto fx = static_cast<float>(x - ix), fy = static_cast<float>(y - iy);
  const auto column = [&](int i) {
    return wrap_u_ ? i % level.width : std::clamp(i - level.width, 0, level.width - 1);
  };
  const int x0 = column(ix), x1 = column(ix + 1);
  const Eigen::Vector3f* row0 = &level.texels[static_cast<std::size_t>(std::ptrdiff_t{iy} * level.width)];
  const Eigen::Vector3f* row1 = &level.texels[static_cast<std::size_t>(
      std::ptrdiff_t{std::min(iy + 1, level.height - 1)} * level.width)];
  const Eigen::Vector3f top = row0[x0] + fx * (row0[x1] - row0[x0]),
                        bottom = row1[x0] + fx * (row1[x1] - row1[x0]);
  return top + fy * (bottom - top);
}

Eigen::Vector3d Texture::Sample(double u, double v, double footprint) const {
  u = std::clamp(u, 0.0, 1.0);
  v = std::clamp(v, 0.0, 1.0);
  const double last = static_cast<double>(levels_.size()) - 1;
  const double texels = std::max(footprint * levels_[0].height, 1.0);
  const double level = std::min(std::log2(texels), last);
  const auto fine = static_cast<std::size_t>(level);
  const auto blend = static_cast<float>(level - static_cast<double>(fine));
  Eigen::Vector3f colour = Bilinear(levels_[fine], u, v);
  if (blend > 0) colour += blend * (Bilinear(levels_[fine + 1], u, v) - colour);
  return colour.cast<double>();
}

}  // namespace samples
