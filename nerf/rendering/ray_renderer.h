// Renders rays through a trained field: waves of a few samples per ray, so that a ray stops as soon as it is
// opaque; or, for fields with a fixed number of samples per ray, at the midpoints of their bins.
#pragma once

#include <span>
#include <vector>

#include "nerf/data/dataset.h"
#include "nerf/fields/scene_field.h"
#include "nerf/rendering/ray_limits.h"

namespace nerf {

struct RenderedRay {
  // Sum of weights times colour, with that at infinity where rays end there, without any background. Along
  // the occupancy grid, neighbouring samples share one colour until they weigh 1e-3 together; a ray with less
  // opacity than that in all stays black.
  float rgb[3];
  float transmittance;  // share of the light that leaves the scene: what shows the background or infinity
  float depth;          // expected distance along the ray; the end of the ray where nothing is hit
  float median_depth;   // where half the light is absorbed; infinity where less is
  float unlearnt;       // share of the light, in rgb, from where the field learnt nothing (IsLearnt)
};

// A pixel of a camera.
struct CameraPixel {
  const RayCamera* camera;
  int x, y;
};

// What is wanted of rays. Depths alone, whose rays stay black, take a quarter less time.
enum class RayValues { kColours, kDepths };

// step_scale is the share of the training interval to sample with (see RenderOptions in trained_field.h). The
// samples_per_pixel rays of a pixel follow one another; along the occupancy grid their first intervals are
// staggered evenly, so that their mean sees the surface at as many depths. Results do not depend on the
// number of workers. Throws io::Interrupted.
std::vector<RenderedRay> RenderRays(const SceneField& scene_field,
                                    std::span<const Ray> rays,
                                    int samples_per_pixel,
                                    float step_scale,
                                    io::Workers* workers,
                                    const RayLimits& limits = {},
                                    RayValues values = RayValues::kColours);

// Means over samples_per_pixel rays of each pixel, a square number, through the centres of its cells. Their
// number in training, scene_field.samples_per_pixel, serves best.
std::vector<RenderedRay> RenderPixels(const SceneField& scene_field,
                                      std::span<const CameraPixel> pixels,
                                      int samples_per_pixel,
                                      float step_scale,
                                      io::Workers* workers,
                                      const RayLimits& limits = {},
                                      RayValues values = RayValues::kColours);

}  // namespace nerf
