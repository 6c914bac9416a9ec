// Scores of a trained field on held-out views. Renders are written as 8-bit PNG first and scored from disk,
// so that anyone who scores the files again gets the same numbers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "io/base/memory.h"
#include "io/image/image.h"
#include "io/image/mask.h"
#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"
#include "pipeline/evaluation/scores.h"

namespace pipeline {

struct EvaluationOptions {
  int every = 1;             // score every n-th held-out view
  int max_strips = 24;       // views to write pictures of into compare/, worst first
  bool error_budget = true;  // measure where the error lies (error_budget.h)
  int threads = 1;
  io::MemoryBudget memory = io::MemoryBudget();  // fewer views are scored at once where it is short
};

// The picture of a frame, on white where it has alpha, and its mask.
struct Truth {
  io::Image picture;
  io::Mask mask;
};
Truth ReadTruth(const io::Frame& frame);
// An RGB picture where what the mask leaves out is dark, but can still be seen.
io::Image DarkenUnused(io::Image picture, const io::Mask& mask);

// 8-bit picture of a rendered view, rounded to nearest. Throws kBadInput naming the first pixel that is not
// finite.
io::Image QuantizeView(const nerf::RenderedView& view);

// How pictures are drawn that are compared with those of the camera.
nerf::RenderOptions OptionsOfScored(const io::Camera& camera, int threads);

// Writes folder/renders/<stem of the truth>.png for every frame of `test`, at the size of its picture; keeps
// those that are there. Throws kBadInput for a distorted camera, a picture of another size or two pictures of
// one stem.
void RenderViews(const nerf::TrainedField& field,
                 const io::Scene& test,
                 const std::filesystem::path& folder,
                 int threads);

// Median PSNR over at most kJudgedTrainingViews evenly spread pictures that the field was trained on,
// rendered for this alone. Nothing without pictures.
inline constexpr int kJudgedTrainingViews = 8;
std::optional<double> TrainingPsnr(const nerf::TrainedField& field, const io::Scene& train, int threads);

// Median over at most kJudgedViews evenly spread views of `test` of the share of sparse points that the field
// hides. Nothing where the scene has too few points.
inline constexpr int kJudgedViews = 24;
std::optional<double> HiddenPoints(const nerf::TrainedField& field,
                                   const io::Scene& train,
                                   const io::Scene& test,
                                   int threads);

// The pictures of folder/compare/ that show one view: the photo, its render, and the FLIP error in magma
// colours.
struct Comparison {
  std::filesystem::path photo, render, error;  // <rank>_<stem>_photo.png and so on
};

// Where they lie. rank: 1 for the worst of n_views views; name: file name of the held-out picture.
Comparison ComparisonPaths(const std::filesystem::path& folder,
                           int rank,
                           int n_views,
                           const std::string& name);

// Scores folder/renders/ against the pictures of `test` where their masks use them, and writes
// folder/compare/, pixels that a mask does not use dark. The result names no protocol. Throws kBadInput for a
// missing render or one of another size.
Scores ScoreViews(const io::Scene& test,
                  const std::filesystem::path& folder,
                  const EvaluationOptions& options);

}  // namespace pipeline
