// How much memory training takes, from what is known before it begins.
#pragma once

#include <cstddef>

#include "io/scene/scene.h"
#include "nerf/data/dataset.h"
#include "nerf/steps/train_options.h"

namespace nerf {

// Bytes of the training pictures and of what is derived from them: with alpha, two bytes per pixel more for
// carving the visual hull.
std::size_t PictureBytes(std::size_t n_pixels, int channels);

// Bytes of the field with its moments, of its gradients and of the batch. Tables are counted as if all were
// full; the `nerf` field is LibTorch's.
std::size_t TrainedFieldBytes(const TrainOptions& options, bool has_alpha);

// Throw kNoResources with the figure when options.memory does not suffice: for the pictures of a scene,
// before they are read, and the field; for hull and field, once the pictures have turned out to have a
// background.
void RequireTrainingMemory(const io::Scene& scene, const TrainOptions& options);
void RequireHullMemory(const Dataset& dataset, const TrainOptions& options);

}  // namespace nerf
