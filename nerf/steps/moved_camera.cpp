#include "nerf/steps/moved_camera.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/base/median.h"

namespace nerf {

std::vector<MovedCamera> MovedCameras(const io::Scene& scene, const CameraRefinement& refinement) {
  const std::vector<double> motions = refinement.Motions();
  const std::vector<io::Rigid3d> poses = refinement.WorldFromCam();
  std::vector<MovedCamera> moved;
  for (std::size_t v = 0; v < motions.size(); ++v) {
    if (motions[v] != 0)
      moved.push_back({scene.frames[v].image_path.filename().string(), motions[v], poses[v]});
  }
  return moved;
}

std::string Describe(const std::vector<MovedCamera>& moved, std::size_t n_views) {
  if (moved.empty()) return "cameras: the pictures pull at none of them";
  std::vector<double> motions;
  for (const MovedCamera& camera : moved) motions.push_back(camera.motion_px);
  return fmt::format(
      "cameras: {} of {} moved where their pictures pulled, by {:.2f} px in the median and at most {:.2f}",
      moved.size(),
      n_views,
      io::Median(motions),
      *std::max_element(motions.begin(), motions.end()));
}

}  // namespace nerf
