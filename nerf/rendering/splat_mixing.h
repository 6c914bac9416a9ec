// The picture of a trained field and that of its splats in one.
//
// The field is smooth and complete; splats are sharp where photographs show them often, and let light pass
// where they do not reach. What they let pass is filled by the field, and a mean of both pictures has less
// error than either: their faults differ, and where each is the better one was measured in the training views
// (fields/share_map.h). Of the fine structure, the splats alone tell as much as this mean
// (EXPERIMENTS.md, Rendering), so that the field's picture may be small. Where the field's surface stands
// well before the splats, it is mostly a floater that no photograph saw from there: such pixels are the
// splats'.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "io/process/parallel.h"
#include "nerf/fields/scene_field.h"
#include "nerf/rendering/rendered_view.h"
#include "nerf/sampling/crop_box.h"
#include "nerf/splatting/splat_rasteriser.h"

namespace nerf {

// A value of the picture, from the field's and that of the splats before the field, which have this share.
inline float MixedValue(float field, float over, float share) {
  return std::clamp(field + share * (over - field), 0.f, 1.f);
}

// The splats' share of a pixel whose ray meets the field's surface at this distance.
float SplatShareAt(const SceneField& scene_field, const Ray& ray, float median_depth);

// A camera's view of splats that look through the pixels of pictures with a focal length of splat_focal_px: a
// longer one magnifies these.
SplatView SplatViewOf(const SceneField& scene_field,
                      const io::Camera& camera,
                      const io::Rigid3d& world_from_cam);

// The scene's splats as a camera sees them, with a crop box those whose middles lie in it. For a focal length
// below kLeastZoom of splat_focal_px the picture of that length is shrunk: between the middles of larger
// pixels thin splats would be missed.
SplatPicture RenderSplats(const SceneField& scene_field,
                          const io::Camera& camera,
                          const io::Rigid3d& world_from_cam,
                          const std::optional<CropBox>& crop,
                          SplatRasteriser* rasteriser);
inline constexpr double kLeastZoom = 0.8;

// How well the field's surface stands before the splats, at each pixel of a view of median_depth: 0 where it
// is farther away than kNearlyAsFar of their distance, 1 where it is nearer than kWellBefore of it; edges of
// things lie in between. 0 as well where one of both is transparent.
inline constexpr float kNearlyAsFar = 0.9f, kWellBefore = 0.8f;
std::vector<float> FieldBeforeSplats(Splats splats,
                                     const io::Camera& camera,
                                     const io::Rigid3d& world_from_cam,
                                     const std::vector<float>& median_depth,
                                     SplatRasteriser* rasteriser);

// view: the field's, in the same box, of the camera's size or smaller. A smaller one is magnified (M) and
// takes what it lacks of the fine structure from the splats before it:
//   field = M(view) + over - M(over of the view and the splats' picture shrunk to its size)
// Splats reach out of a box; there they count as far as the field is opaque, so that the background stays
// clean. Without splats nothing changes.
void MixSplats(const SceneField& scene_field,
               const io::Camera& camera,
               const io::Rigid3d& world_from_cam,
               const std::optional<CropBox>& crop,
               io::Workers* workers,
               RenderedView* view);

}  // namespace nerf
