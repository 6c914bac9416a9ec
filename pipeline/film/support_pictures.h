// Pictures of support: how many training views saw what a picture shows, and from how far apart.
#pragma once

#include <filesystem>
#include <vector>

#include "io/image/image.h"
#include "nerf/rendering/support_map.h"

namespace pipeline {

// Colours (turbo) of the number of views, from one to all `n_views` in steps of equal ratio, black where no
// view saw the surface; width x height pixels.
io::Image ViewCountPicture(const nerf::ViewSupport& support, int n_views, int width, int height);

// Colours (turbo) of the largest angle between two of the views, from 0 to kLargestAngle_deg.
io::Image ViewAnglePicture(const nerf::ViewSupport& support, int width, int height);

// Depth is measured best near this angle, and few pictures match beyond it.
inline constexpr double kLargestAngle_deg = 60;

// Outside of the crop box, where the view shows nothing, nothing is shown that a view could have seen.
void DropTransparent(const nerf::RenderedView& view, nerf::ViewSupport* support);

// The pictures of render/support/ that belong to one frame of the film.
struct SupportPictures {
  int frame = 0;                                // from 0
  std::filesystem::path picture, views, angle;  // 000001_picture.png and so on
};
SupportPictures SupportPicturePaths(const std::filesystem::path& render_folder, int frame);
// Those that exist, in order.
std::vector<SupportPictures> FindSupportPictures(const std::filesystem::path& render_folder);

}  // namespace pipeline
