// Scores of a trained field on held-out views. Renders are written as 8-bit PNG first and scored from disk,
// so that anyone who scores the files again gets the same numbers.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/image/image.h"
#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"

namespace pipeline {

// Pixels of white between the three pictures of a comparison strip.
inline constexpr int kStripGap = 8;

struct EvaluationOptions {
  int every = 1;        // score every n-th held-out view
  int max_strips = 24;  // comparison strips to write, worst views first
  int threads = 1;
};

struct ViewScore {
  std::string name;  // file name of the held-out picture
  double mse = 0;    // over used pixels and channels, values in [0, 1]
  double psnr_db = 0, ssim = 0, flip = 0;
  bool identical = false;  // render equals truth in every bit; PSNR is then the cap, nerf::kMaxPsnrDb
};

struct Evaluation {
  int width = 0, height = 0;               // of the first view
  bool white_background = false;           // a truth picture has alpha and was composited on white
  bool masked = false;                     // a view has a mask; all figures are over used pixels
  std::vector<ViewScore> views;            // in the order of the scene's frames
  double psnr_db = 0, ssim = 0, flip = 0;  // means over the views
  double psnr_of_mean_mse_db = 0;

  std::vector<int> WorstFirst() const;  // view indices by rising PSNR
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
// the worst PSNR. Throws kBadInput for a missing render or one of another size.
Evaluation ScoreViews(const io::Scene& test,
                      const std::filesystem::path& folder,
                      const EvaluationOptions& options);

// folder/metrics.json and folder/per_image.csv.
void WriteScores(const Evaluation& evaluation,
                 const std::string& protocol,
                 const std::filesystem::path& folder);

}  // namespace pipeline
