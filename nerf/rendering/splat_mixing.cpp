#include "nerf/rendering/splat_mixing.h"

#include <algorithm>

#include "nerf/splatting/splat_rasteriser.h"

namespace nerf {

SplatView SplatViewOf(const SceneField& scene_field,
                      const io::Camera& camera,
                      const io::Rigid3d& world_from_cam) {
  const double zoom = std::max(1.0, camera.fl_x / static_cast<double>(scene_field.splat_focal_px));
  return {camera, world_from_cam, zoom * zoom * kLowPass};
}

void MixSplats(const SceneField& scene_field,
               const io::Camera& camera,
               const io::Rigid3d& world_from_cam,
               io::Workers* workers,
               std::vector<float>* rgb) {
  if (scene_field.splats.size() == 0) return;
  const SplatPicture picture =
      SplatRasteriser(workers).Render(scene_field.splats, SplatViewOf(scene_field, camera, world_from_cam));
  for (std::size_t i = 0; i < rgb->size(); ++i)
    (*rgb)[i] = MixedValue((*rgb)[i], picture.rgb[i], picture.transmittance[i / 3], scene_field.splat_share);
}

}  // namespace nerf
