// metrics.json: how well the held-out views are rendered, view by view and on average.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pipeline {

struct ViewScore {
  std::string name;  // file name of the held-out picture
  double psnr_db = 0, ssim = 0, flip = 0;
  double aligned_psnr_db = 0;  // with the colours aligned, see nerf::ColourAlignedError
  bool identical = false;      // render equals truth in every bit; PSNR is then the cap, nerf::kMaxPsnrDb
};

struct Scores {
  std::string protocol;                    // which views were held out, and how they are compared (README.md)
  int width = 0, height = 0;               // of the first view
  bool white_background = false;           // a truth picture has alpha and was composited on white
  bool masked = false;                     // a view has a mask; all figures are over used pixels
  std::vector<ViewScore> views;            // in the order of the scene's frames
  double psnr_db = 0, ssim = 0, flip = 0;  // means over the views
  double psnr_of_mean_mse_db = 0, aligned_psnr_db = 0;
  // Medians: of some training pictures, and of held-out pictures replaced by their own mean colour.
  std::optional<double> training_psnr_db, plain_psnr_db;

  std::vector<int> WorstFirst() const;  // view indices by rising PSNR
};

// Writes folder/metrics.json, and the figures of each view into folder/per_image.csv too.
void WriteScores(const Scores& scores, const std::filesystem::path& folder);

// Throws kBadInput naming the file and the place when folder/metrics.json is absent or damaged.
Scores ReadScores(const std::filesystem::path& folder);

}  // namespace pipeline
