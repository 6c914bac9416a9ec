// A field together with the space it lives in: all that rendering needs, and what a checkpoint stores.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "io/process/parallel.h"
#include "nerf/data/dataset.h"
#include "nerf/fields/hash_field.h"
#include "nerf/fields/mlp_field.h"
#include "nerf/fields/share_map.h"
#include "nerf/sampling/occupancy_grid.h"
#include "nerf/sampling/sampler.h"
#include "nerf/splatting/splats.h"

namespace nerf {

struct SceneField {
  SceneField(const SceneContraction& space,
             const SamplerOptions& sampling,
             std::unique_ptr<RadianceField> radiance_field,
             int grid_resolution)
      : contraction(space),
        sampler_options(sampling),
        field(std::move(radiance_field)),
        grid(grid_resolution, contraction) {}
  SceneField(const SceneField&) = delete;  // the grid refers to the contraction

  // Whether a ray that leaves the scene ends at infinity, on an opaque sample there, which has a colour as
  // any other. What has no parallax, such as sky or a dark room around a lit subject, is then explained
  // far away instead of by walls and fog before each camera.
  bool EndsAtInfinity() const { return contraction.unbounded && field->kind() == FieldKind::kHash; }
  // What shows where light leaves the scene: what was told apart in the pictures; `chosen` where their alpha
  // left it free; black for rays that end at infinity, whose light is complete; else the mean of all
  // backgrounds, against which opaque pictures are trained.
  std::array<float, 3> Background(bool has_alpha, const std::array<float, 3>& chosen) const;

  SceneContraction contraction;
  SamplerOptions sampler_options;
  std::unique_ptr<RadianceField> field;
  OccupancyGrid grid;
  // A pixel is the mean of so many rays, a square number, one through each cell of a square lattice on it.
  int samples_per_pixel = 1;
  // Sampling intervals of the last training step, in those of sampler_options: longer at first, and finer
  // ones show nothing more. 1 when the field is trained.
  float step_scale = 1;
  // Of opaque pictures that share one (plain_background.h), sRGB in [0, 1].
  std::optional<std::array<float, 3>> background;
  // Fitted to photographs, and mixed into pictures (rendering/splat_mixing.h); may be none.
  Splats splats;
  float splat_focal_px = 1;  // of the pictures that they were fitted to
  float splat_share = 0.5f;  // in pictures; the field has the rest
  ShareMap splat_shares;     // the same by place, where that is known
  // The same where they lie well behind the field's surface (rendering/splat_mixing.h); no more if smaller.
  float splat_share_behind = 0;
};

// Overrides of what is otherwise derived from the scene; 0 keeps the derivation.
struct SceneFieldOptions {
  FieldKind kind = FieldKind::kHash;
  int log2_hashmap_size = 0;
  int finest_resolution = 0;
  double finest_cell_pixels = 0.9;
  bool entry_moments = false;  // of the tables' optimiser, see hash_grid.h
  int grid_resolution = 0;
  // `hash`: tables looked up, and products computed, in bfloat16.
  bool bf16_table = false, bf16_network = false;
  MlpFieldOptions mlp;

  // Where in its pixel a ray starts, see RadianceField::pixel_offset.
  double PixelOffset() const { return kind == FieldKind::kMlp && !mlp.pixel_centres ? 0.0 : 0.5; }
};

// Sizes the field by what the scene needs (the derivation is returned as one line of text):
//   pixel footprint p = distance / focal length (median over views): bounded, to the centre of the region of
//               interest; unbounded, to the sparse points that each view observes
//   intervals   1.5 p (bounded); 4 p, in proportion to distance (unbounded)
//   finest grid cells of 0.9 p, coarsest 16 per axis, tables of 2^17 entries per level, unless the budget
//   says otherwise (nerf/steps/training_schedule.h)
// Pictures with alpha, given or from a plain background: the space is the cube around their visual hull.
// Others: contracted space around a cube at the centre of the region of interest, whose half side is the
// median distance of views from the points that they observe.
// `nerf` has intervals of (far - near) / 192 in bounded scenes, as many as the report has samples; with a
// fixed number of samples per ray these lie between near and far.
std::unique_ptr<SceneField> MakeSceneField(const io::Scene& scene,
                                           const Dataset& dataset,
                                           const SceneFieldOptions& options,
                                           std::uint64_t seed,
                                           io::Workers* workers,
                                           std::string* derivation);

}  // namespace nerf
