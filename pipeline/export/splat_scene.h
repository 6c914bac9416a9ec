// A trained field as splats: begun on the surfaces that its views show, then fitted to pictures.
#pragma once

#include "nerf/splatting/splats.h"
#include "pipeline/export/exported_scene.h"

namespace pipeline {

struct SplatSceneOptions {
  int view_size = 512;  // longer side of the pictures fitted to [px]; 0: that of the training pictures
  int max_splats = 200000;
  int steps = 1000;  // of one picture each
};

// The aim are the photos of the training views where their masks use them, else the field's pictures of these
// views; with a crop box, or where the background of the pictures is free or plain, the field's pictures of
// what lies inside, and what lets light pass stays transparent. Where rays leave the scene without a surface,
// splats show the sky. In scene coordinates; fewer splats where pixels are fewer. Needs scene.field. Throws
// kBadState when the views show nothing, kBadInput for photos that cannot be read, and io::Interrupted.
nerf::Splats MakeSplats(const ExportedScene& scene, const SplatSceneOptions& options);

// Splats of the training, which leave the sky to the field behind them, with others that show it where they
// let most light pass and the training views have no surface. They are not fitted: a sky has little detail.
// Needs scene.field. Throws io::Interrupted.
nerf::Splats WithSky(const ExportedScene& scene,
                     const nerf::Splats& splats,
                     const SplatSceneOptions& options);

}  // namespace pipeline
