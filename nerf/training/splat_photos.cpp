#include "nerf/training/splat_photos.h"

#include <utility>

#include "io/base/median.h"
#include "io/image/image.h"
#include "nerf/rendering/splat_mixing.h"
#include "nerf/rendering/support_map.h"

namespace nerf {

bool IsShown(const SplatTarget& target, std::size_t pixel) {
  return (target.used.empty() || target.used[pixel]) && target.rgba[4 * pixel + 3] > 0;
}

SplatPhotos::SplatPhotos(const io::Scene& scene,
                         const Dataset& dataset,
                         std::vector<io::Rigid3d> world_from_cam,
                         const SceneField& scene_field)
    : scene_(scene),
      dataset_(dataset),
      world_from_cam_(std::move(world_from_cam)),
      used_(dataset.UsedPixels()),
      scene_field_(scene_field) {}

io::Camera SplatPhotos::Camera(std::size_t view, int side) const {
  return SmallCamera(scene_.cameras[static_cast<std::size_t>(scene_.frames[view].camera_index)], side);
}

SplatTarget SplatPhotos::Target(std::size_t index) const {
  const View& view = dataset_.views[index];
  io::Image photo{.width = view.width, .height = view.height, .channels = 4};
  photo.data.reserve(4 * view.n_pixels());
  for (std::size_t i = view.first_pixel; i < view.first_pixel + view.n_pixels(); ++i) {
    photo.data.insert(photo.data.end(), &dataset_.pixels[3 * i], &dataset_.pixels[3 * i] + 3);
    photo.data.push_back(dataset_.ShowsSky(i) ? 0 : 255);
  }
  io::Mask mask{.width = view.width, .height = view.height, .used = {}};
  for (std::size_t i = 0; i < view.n_pixels() && !used_.empty(); ++i)
    mask.used.push_back(used_[view.first_pixel + i] ? 255 : 0);

  const io::Camera camera = Camera(index, kSplatPhotoSide);
  if (camera.width != photo.width || camera.height != photo.height) {
    photo = io::ResizeArea(photo, camera.width, camera.height);
    if (!mask.used.empty()) mask = io::ShrinkMask(mask, camera.width, camera.height);
  }
  SplatTarget target{SplatViewOf(scene_field_, camera, world_from_cam_[index]), {}, {}};
  for (std::size_t i = 0; i < photo.data.size() / 4; ++i) {
    const int alpha = photo.data[4 * i + 3];
    for (std::size_t c = 0; c < 3; ++c)
      target.rgba.push_back(static_cast<std::uint8_t>((photo.data[4 * i + c] * alpha + 127) / 255));
    target.rgba.push_back(photo.data[4 * i + 3]);
    if (!mask.used.empty()) target.used.push_back(mask.Uses(i));
  }
  return target;
}

double SplatPhotos::FocalLength() const {
  std::vector<double> focal_lengths;
  for (std::size_t view = 0; view < size(); ++view)
    focal_lengths.push_back(Camera(view, kSplatPhotoSide).fl_x);
  return io::Median(std::move(focal_lengths));
}

}  // namespace nerf
