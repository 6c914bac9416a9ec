// The options of `pipeline sfm`, `normalize`, `evaluate` and `render`, without those that all stages have.
// Apart from the stages, so that `pipeline run` can offer them without loading what the stages need.
#pragma once

#include <filesystem>
#include <string>

#include "pipeline/evaluation/evaluation.h"
#include "pipeline/film/film.h"
#include "pipeline/stage/options.h"
#include "sfm/reconstruction.h"

namespace pipeline {

struct NormalizeFlags {
  std::filesystem::path poses, images;
  int image_size = 512;  // longest side [px]; 0: keep
  std::string holdout = "every";
  int holdout_every = 8;
};

struct FilmFlags {
  FilmOptions film;
  std::string max_time = "3m";  // FilmOptions::ceiling_s
};

void AddSfmOptions(Options* options, sfm::ReconstructionOptions* sfm);
void AddNormalizeOptions(Options* options, NormalizeFlags* normalize);
void AddEvaluateOptions(Options* options, EvaluationOptions* evaluate);
void AddRenderOptions(Options* options, FilmFlags* render);

}  // namespace pipeline
