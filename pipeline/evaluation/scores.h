// metrics.json: how well the held-out views are rendered, view by view and on average.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace pipeline {

// Where the error of a view lies, or the mean over views. The fits look at the photograph: they bound what
// right poses and colours would gain, and are no scores.
struct ErrorBudget {
  double psnr_db = 0;                 // as it is
  double fitted_psnr_db = 0;          // rendered at the pose near its own that shows the photograph best
  double fitted_aligned_psnr_db = 0;  // and with the colours aligned
  double moved_px = 0;                // to that pose, RMS over the picture
  // Of the render at that pose:
  double sharpness = 0;                        // its squared slopes, as a share of the photograph's
  double worst_error = 0;                      // share of the squared error in the worst 5 % of the pixels
  double unseen_pixels = 0, unseen_error = 0;  // shares where few training views saw the surface

  bool operator==(const ErrorBudget&) const = default;
};
inline constexpr int kFewViews = 3;  // fewer are few

// Its fields, by their names in metrics.json.
inline constexpr std::pair<const char*, double ErrorBudget::*> kErrorBudgetFields[] = {
    {"psnr", &ErrorBudget::psnr_db},
    {"pose_fitted_psnr", &ErrorBudget::fitted_psnr_db},
    {"pose_fitted_colour_aligned_psnr", &ErrorBudget::fitted_aligned_psnr_db},
    {"pose_moved_px", &ErrorBudget::moved_px},
    {"sharpness", &ErrorBudget::sharpness},
    {"error_in_worst_5_percent", &ErrorBudget::worst_error},
    {"pixels_seen_by_few", &ErrorBudget::unseen_pixels},
    {"error_seen_by_few", &ErrorBudget::unseen_error}};

struct ViewScore {
  std::string name;  // file name of the held-out picture
  double psnr_db = 0, ssim = 0, flip = 0;
  double aligned_psnr_db = 0;  // with the colours aligned, see nerf::ColourAlignedError
  bool identical = false;      // render equals truth in every bit; PSNR is then the cap, nerf::kMaxPsnrDb
  std::optional<ErrorBudget> budget;
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
  // Median over the views of the share of sparse points that the field hides
  // (nerf/rendering/hidden_points.h).
  std::optional<double> hidden_points;
  std::optional<ErrorBudget> budget;  // mean over the views that have one

  std::vector<std::size_t> WorstFirst() const;  // view indices by rising PSNR
};

// Writes folder/metrics.json, and the figures of each view into folder/per_image.csv too.
void WriteScores(const Scores& scores, const std::filesystem::path& folder);

// Throws kBadInput naming the file and the place when folder/metrics.json is absent or damaged.
Scores ReadScores(const std::filesystem::path& folder);

}  // namespace pipeline
