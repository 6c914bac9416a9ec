// The photographs as splats are fitted to them.
#pragma once

#include <vector>

#include "nerf/data/dataset.h"
#include "nerf/fields/scene_field.h"
#include "nerf/splatting/splat_rasteriser.h"

namespace nerf {

// Longer side of the pictures that splats are fitted to, in pixels.
inline constexpr int kSplatPhotoSide = 512;

// Whether the splats are to show a pixel: it is used, and no sky.
bool IsShown(const SplatTarget& target, std::size_t pixel);

class SplatPhotos {
 public:
  // All must outlive this. The frames of `scene` are the views of `dataset`, RGB; world_from_cam: theirs, as
  // the field saw them.
  SplatPhotos(const io::Scene& scene,
              const Dataset& dataset,
              std::vector<io::Rigid3d> world_from_cam,
              const SceneField& scene_field);

  std::size_t size() const { return dataset_.views.size(); }
  const io::Rigid3d& world_from_cam(std::size_t view) const { return world_from_cam_[view]; }
  // With a longer side of at most `side` pixels.
  io::Camera Camera(std::size_t view, int side) const;
  // A photograph with a longer side of kSplatPhotoSide at most. Its sky is transparent: it is left to the
  // field behind the splats.
  SplatTarget Target(std::size_t view) const;
  // The median of their focal lengths in pixels, at that size.
  double FocalLength() const;

 private:
  const io::Scene& scene_;
  const Dataset& dataset_;
  const std::vector<io::Rigid3d> world_from_cam_;
  const std::vector<bool> used_;  // of all pixels; empty: all
  const SceneField& scene_field_;
};

}  // namespace nerf
