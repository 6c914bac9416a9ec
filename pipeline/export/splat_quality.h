// How good splats are: their pictures of held-out views, which nothing was fitted to.
#pragma once

#include <optional>

#include "nerf/splatting/splats.h"
#include "pipeline/export/exported_scene.h"

namespace pipeline {

// Means over the views of PSNR of 8-bit pictures [dB].
struct SplatQuality {
  int views = 0;
  double splats_db = 0, field_db = 0;  // against the photos
  double apart_db = 0;                 // splats and field
};

// Of at most 16 test views, evenly spread, at the photos' size, by nerf/splatting/plain_rasteriser.h. Nothing
// without such views or with a crop box. Needs scene.field. Throws kBadInput for photos that cannot be read,
// and io::Interrupted.
std::optional<SplatQuality> MeasureSplats(const ExportedScene& scene, const nerf::Splats& splats);

}  // namespace pipeline
