// How much of the picture is to be the splats', from what field and splats make of the training views.
#pragma once

#include <span>

#include "io/process/parallel.h"
#include "nerf/fields/scene_field.h"
#include "nerf/training/splat_photos.h"

namespace nerf {

// Of the pixels of some of these views, those whose surface in the field stands well before the splats.
double FieldBeforeShare(const SceneField& scene_field,
                        const SplatPhotos& photos,
                        std::span<const std::size_t> views,
                        io::Workers* workers);

// scene_field.splat_share by place. Of two pictures with independent errors, the mean by the inverse of these
// is the best: a share s has the odds s / (1 - s) = squared error of the field : that of the splats. Here,
// field F and splats S are compared with photographs P at some pixels of these views, and in each cell where
// their surfaces lie the share that fits best, sum (S - F) . (P - F) / sum (S - F)^2, is set against that of
// all pixels: the odds are those of splat_share times the square root of the ratio of both odds. The root,
// since in training views both know the photographs. Empty where field and splats are the same.
ShareMap SharesByPlace(const SceneField& scene_field,
                       const SplatPhotos& photos,
                       std::span<const std::size_t> views,
                       io::Workers* workers);

}  // namespace nerf
