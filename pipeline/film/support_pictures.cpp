#include "pipeline/film/support_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "io/image/colour_map.h"
#include "io/video/video_writer.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

// Colours of share(i) at the pixels of the map, black where it is negative.
template <typename Share>
io::Image Picture(const nerf::ViewSupport& support, int width, int height, const Share& share) {
  std::vector<float> shares;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      shares.push_back(share(
          static_cast<std::size_t>(y * support.height / height * support.width + x * support.width / width)));
  }
  io::Image picture = io::ApplyColourMap(shares, width, height, io::ColourMap::kTurbo);
  for (std::size_t i = 0; i < picture.data.size(); ++i) {
    if (shares[i / 3] < 0) picture.data[i] = 0;
  }
  return picture;
}

}  // namespace

io::Image ViewCountPicture(const nerf::ViewSupport& support, int n_views, int width, int height) {
  const double all = std::log(std::max(2, n_views));
  return Picture(support, width, height, [&](std::size_t i) {
    return support.views[i] == 0 ? -1.f : static_cast<float>(std::log(support.views[i]) / all);
  });
}

io::Image ViewAnglePicture(const nerf::ViewSupport& support, int width, int height) {
  constexpr double kLargest = kLargestAngle_deg * std::numbers::pi / 180;
  return Picture(support, width, height, [&](std::size_t i) {
    return support.views[i] == 0 ? -1.f
                                 : static_cast<float>(static_cast<double>(support.angle[i]) / kLargest);
  });
}

void DropTransparent(const nerf::RenderedView& view, nerf::ViewSupport* support) {
  constexpr float kShown = 0.5f;  // opacity
  for (int y = 0; y < support->height; ++y) {
    for (int x = 0; x < support->width; ++x) {
      const int u = (2 * x + 1) * view.width / (2 * support->width),
                v = (2 * y + 1) * view.height / (2 * support->height);
      const auto at = static_cast<std::size_t>(y * support->width + x);
      if (view.opacity[static_cast<std::size_t>(v * view.width + u)] >= kShown) continue;
      support->views[at] = 0;
      support->angle[at] = 0;
    }
  }
}

SupportPictures SupportPicturePaths(const fs::path& render_folder, int frame) {
  const std::string stem = fs::path(io::VideoFrameName(frame)).stem().string();
  const auto path = [&](const char* what) { return render_folder / "support" / (stem + what); };
  return {frame, path("_picture.png"), path("_views.png"), path("_angle.png")};
}

std::vector<SupportPictures> FindSupportPictures(const fs::path& render_folder) {
  std::vector<SupportPictures> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(render_folder / "support", error)) {
    const int number = std::atoi(entry.path().filename().c_str());
    const SupportPictures pictures = SupportPicturePaths(render_folder, number - 1);
    if (number > 0 && entry.path() == pictures.views && fs::is_regular_file(pictures.picture) &&
        fs::is_regular_file(pictures.angle))
      found.push_back(pictures);
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.frame < b.frame; });
  return found;
}

}  // namespace pipeline
