#include "pipeline/film/film_size.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace pipeline {
namespace {

// Below this, encoders refuse the picture or pad it.
constexpr int kMinSide = 32;
// The speed of so many smaller sizes is tried at most.
constexpr int kSizesTried = 4;
// Below, what is seen of the field alone becomes blurred.
constexpr double kLeastFieldShare = 0.35;

int EvenSide(double pixels) { return std::max(kMinSide, 2 * static_cast<int>(std::lround(pixels / 2))); }

}  // namespace

io::Camera EvenCamera(const io::Camera& camera, double width) {
  const int even_width = EvenSide(width);
  return io::ResizedCamera(
      camera, even_width, EvenSide(static_cast<double>(even_width) / camera.width * camera.height));
}

io::Camera FilmCamera(const io::Scene& train, int width, int photo_side) {
  const io::Camera& camera = train.cameras.at(static_cast<std::size_t>(train.frames.at(0).camera_index));
  if (width > 0) return EvenCamera(camera, width);
  const int trained = std::max(camera.width, camera.height);
  const int side = std::min(kFilmSide, std::max(trained, photo_side));
  return EvenCamera(camera, static_cast<double>(camera.width) * side / trained);
}

std::string KeepUnder(double ceiling_s,
                      int trained_width,
                      bool has_splats,
                      const std::function<double()>& expected_s,
                      FilmSize* size) {
  const io::Camera largest = size->camera;
  const int least = EvenCamera(largest, trained_width).width;
  const double first_share = size->field_share, first_s = expected_s();
  double now_s = first_s;
  for (int k = 0; k < kSizesTried && now_s > ceiling_s; ++k) {
    const double shrink = std::sqrt(ceiling_s / now_s);
    if (has_splats && size->field_share > kLeastFieldShare) {
      size->field_share = std::max(kLeastFieldShare, shrink * size->field_share);
    } else if (size->camera.width > least) {
      size->camera = EvenCamera(largest, std::max<double>(least, shrink * size->camera.width));
    } else {
      break;
    }
    now_s = expected_s();
  }
  if (first_s <= ceiling_s) return "";
  std::string line = fmt::format("film {} wide", size->camera.width);
  if (size->camera.width < largest.width) line += fmt::format(" instead of {}", largest.width);
  if (size->field_share < first_share)
    line += fmt::format(", the field under the splats at {:.0f} % of its size", 100 * size->field_share);
  return line +
         fmt::format(": else the frames would take {:.0f} s; the ceiling is {:.0f} s", first_s, ceiling_s);
}

}  // namespace pipeline
