// Scores of a trained field on held-out views. Renders are written as 8-bit PNG first and scored from disk,
// so that anyone who scores the files again gets the same numbers.
#pragma once

#include <filesystem>

#include "io/image/image.h"
#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"
#include "pipeline/stages/scores.h"

namespace pipeline {

// Pixels of white between the three pictures of a comparison strip.
inline constexpr int kStripGap = 8;

struct EvaluationOptions {
  int every = 1;        // score every n-th held-out view
  int max_strips = 24;  // comparison strips to write, worst views first
  int threads = 1;
};

// 8-bit picture of a rendered view, rounded to nearest. Throws kBadInput naming the first pixel that is not
// finite.
io::Image QuantizeView(const nerf::RenderedView& view);

// Writes folder/renders/<stem of the truth>.png for every frame of `test`, at the size of its picture; keeps
// those that are there. Throws kBadInput for a distorted camera, a picture of another size or two pictures of
// one stem.
void RenderViews(const nerf::TrainedField& field,
                 const io::Scene& test,
                 const std::filesystem::path& folder,
                 int threads);

// Scores folder/renders/ against the pictures of `test` where their masks use them; writes
// folder/compare/<rank>_<stem>.png (truth | render | FLIP error in magma colours, unused pixels dark), rank 1
// the worst PSNR. The result names no protocol. Throws kBadInput for a missing render or one of another size.
Scores ScoreViews(const io::Scene& test,
                  const std::filesystem::path& folder,
                  const EvaluationOptions& options);

}  // namespace pipeline
