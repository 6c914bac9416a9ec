#include "pipeline/evaluation/error_budget.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "io/base/check.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "io/process/ranks.h"
#include "nerf/metrics/metrics.h"
#include "nerf/rendering/pose_fit.h"
#include "nerf/rendering/support_map.h"
#include "pipeline/evaluation/evaluation.h"

namespace pipeline {
namespace {

constexpr double kWorstPixels = 0.05;
// What is worth a sentence: gains; a gap to the training pictures; renders that are so much smoother than
// photographs.
constexpr double kWorthwhileDb = 0.5, kGapDb = 2, kSoft = 0.7;
constexpr double kSmallestShare = 1e-3;  // keeps logarithms finite

// Of each used pixel, the squared error over the channels; 0 for others.
std::vector<double> SquaredErrors(const io::Image& truth, const io::Image& render, const io::Mask& mask) {
  std::vector<double> errors(truth.data.size() / 3, 0);
  for (std::size_t i = 0; i < truth.data.size(); ++i) {
    const double difference = static_cast<double>(truth.data[i]) - render.data[i];
    if (mask.Uses(i / 3)) errors[i / 3] += difference * difference;
  }
  return errors;
}

// Sum of squared differences between used neighbours, over the channels.
double SquaredSlopes(const io::Image& image, const io::Mask& mask) {
  double sum = 0;
  const auto width = static_cast<std::size_t>(image.width);
  const auto add = [&](std::size_t a, std::size_t b) {
    if (!mask.Uses(a) || !mask.Uses(b)) return;
    for (std::size_t c = 0; c < 3; ++c) {
      const double slope = static_cast<double>(image.data[3 * a + c]) - image.data[3 * b + c];
      sum += slope * slope;
    }
  };
  for (std::size_t i = 0; i < image.data.size() / 3; ++i) {
    if ((i + 1) % width != 0) add(i, i + 1);
    if (i >= width) add(i, i - width);
  }
  return sum;
}

double ShareOf(double part, double whole) { return whole > 0 ? part / whole : 0; }

// Of the squared error, the share of the worst pixels.
double WorstShare(std::vector<double> errors, const io::Mask& mask) {
  const double sum = std::accumulate(errors.begin(), errors.end(), 0.0);
  const std::size_t n_used = mask.used.empty() ? errors.size() : mask.UsedCount();
  const auto n =
      std::max<std::size_t>(1, static_cast<std::size_t>(kWorstPixels * static_cast<double>(n_used)));
  const auto end = errors.begin() + static_cast<std::ptrdiff_t>(n);
  std::nth_element(errors.begin(), end - 1, errors.end(), std::greater<>());
  const double worst = std::accumulate(errors.begin(), end, 0.0);
  return ShareOf(worst, sum);
}

// The shares where fewer than kFewViews support the pixel of the smaller map.
void MeasureUnseen(const nerf::ViewSupport& support,
                   const Truth& truth,
                   const std::vector<double>& errors,
                   ErrorBudget* budget) {
  double n = 0, unseen = 0, sum = 0, unseen_sum = 0;
  const int width = truth.picture.width, height = truth.picture.height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto i = static_cast<std::size_t>(y * width + x);
      if (!truth.mask.Uses(i)) continue;
      const int u = x * support.width / width, v = y * support.height / height;
      const bool is_unseen = support.views[static_cast<std::size_t>(v * support.width + u)] < kFewViews;
      n += 1, sum += errors[i];
      if (is_unseen) unseen += 1, unseen_sum += errors[i];
    }
  }
  budget->unseen_pixels = ShareOf(unseen, n);
  budget->unseen_error = ShareOf(unseen_sum, sum);
}

ErrorBudget BudgetOf(const nerf::TrainedField& field,
                     const nerf::SupportMap& support,
                     const io::Camera& camera,
                     const io::Frame& frame,
                     double psnr_db,
                     int threads) {
  const Truth truth = ReadTruth(frame);
  nerf::FittedPose fit =
      nerf::FitPose(field, camera, frame.world_from_cam, truth.picture, truth.mask, threads);
  nerf::RenderedView view;
  io::Image render;
  ErrorBudget budget;
  budget.psnr_db = psnr_db;
  const auto render_at = [&](const io::Rigid3d& world_from_cam) {
    view = field.Render(camera, world_from_cam, OptionsOfScored(camera, threads));
    render = QuantizeView(view);
    budget.fitted_psnr_db = nerf::PsnrFromMse(nerf::MeanSquaredError(truth.picture, render, truth.mask));
  };
  render_at(fit.world_from_cam);
  if (budget.fitted_psnr_db < psnr_db) {  // the fit looked at smaller pictures, and less at large errors
    fit = {.world_from_cam = frame.world_from_cam};
    render_at(fit.world_from_cam);
  }
  budget.moved_px = fit.moved_px;
  budget.fitted_aligned_psnr_db =
      nerf::PsnrFromMse(nerf::ColourAlignedError(truth.picture, render, truth.mask));
  budget.sharpness = ShareOf(SquaredSlopes(render, truth.mask), SquaredSlopes(truth.picture, truth.mask));
  const std::vector<double> errors = SquaredErrors(truth.picture, render, truth.mask);
  budget.worst_error = WorstShare(errors, truth.mask);
  MeasureUnseen(support.Of(camera, fit.world_from_cam, view, threads), truth, errors, &budget);
  return budget;
}

ErrorBudget MeanBudget(const std::vector<ViewScore>& views) {
  ErrorBudget mean;
  double n = 0;
  for (const ViewScore& view : views) {
    if (!view.budget) continue;
    n += 1;
    for (const auto& [name, value] : kErrorBudgetFields) mean.*value += *view.budget.*value;
  }
  for (const auto& [name, value] : kErrorBudgetFields) mean.*value /= n;
  return mean;
}

// Names of the views with most error where few training views saw the surface.
std::string LeastSeen(const Scores& scores) {
  constexpr std::size_t kNames = 3;
  std::vector<const ViewScore*> views;
  for (const ViewScore& view : scores.views) {
    if (view.budget) views.push_back(&view);
  }
  std::stable_sort(views.begin(), views.end(), [](const ViewScore* a, const ViewScore* b) {
    return a->budget->unseen_error > b->budget->unseen_error;
  });
  std::vector<std::string> names;
  for (std::size_t i = 0; i < std::min(kNames, views.size()); ++i) names.push_back(views[i]->name);
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

void MeasureErrors(const nerf::TrainedField& field,
                   const io::Scene& train,
                   const io::Scene& test,
                   int threads,
                   Scores* scores) {
  PIPELINE_CHECK_EQ(scores->views.size(), test.frames.size());
  const nerf::SupportMap support(field, train, threads);
  io::Progress progress("evaluate: error budget");
  const std::size_t n_views = test.frames.size(), n = std::min(n_views, kBudgetViews);
  std::vector<ErrorBudget> budgets(n);
  for (const std::size_t k : io::OwnTasks(n)) {
    io::ThrowIfInterrupted();
    const std::size_t i = k * n_views / n;
    const io::Frame& frame = test.frames[i];
    budgets[k] = BudgetOf(field,
                          support,
                          test.cameras[static_cast<std::size_t>(frame.camera_index)],
                          frame,
                          scores->views[i].psnr_db,
                          threads);
    progress.Update(static_cast<double>(k + 1) / static_cast<double>(n));
  }
  io::GatherTasks(&budgets);
  for (std::size_t k = 0; k < n; ++k) scores->views[k * n_views / n].budget = budgets[k];
  scores->budget = MeanBudget(scores->views);
}

std::vector<std::string> Advice(const Scores& scores) {
  if (!scores.budget) return {};
  const ErrorBudget& budget = *scores.budget;
  const double poses = budget.fitted_psnr_db - budget.psnr_db,
               colours = budget.fitted_aligned_psnr_db - budget.fitted_psnr_db,
               unseen = 10 * std::log10(std::max(1 - budget.unseen_pixels, kSmallestShare) /
                                        std::max(1 - budget.unseen_error, kSmallestShare)),
               gap = scores.training_psnr_db.value_or(scores.psnr_db) - scores.psnr_db;
  std::vector<std::pair<double, std::string>> causes;
  if (poses >= kWorthwhileDb)
    causes.emplace_back(
        poses,
        fmt::format("Poses: shown from its own best place each view would have {:.1f} dB more. "
                    "Keep the subject still, and photograph with more overlap",
                    poses));
  if (colours >= kWorthwhileDb)
    causes.emplace_back(
        colours,
        fmt::format("Colours: pictures differ in brightness or tint by {:.1f} dB. Lock exposure "
                    "and white balance of the camera",
                    colours));
  if (unseen >= kWorthwhileDb)
    causes.emplace_back(
        unseen,
        fmt::format("Views: {:.0f} % of the error lie where fewer than {} training pictures look "
                    "({:.0f} % of the pixels). Photograph more around what {} show",
                    100 * budget.unseen_error,
                    kFewViews,
                    100 * budget.unseen_pixels,
                    LeastSeen(scores)));
  if (gap >= kGapDb)
    causes.emplace_back(
        gap / 2,
        fmt::format("Pictures: those that were trained on are {:.1f} dB better. Photograph more "
                    "views between neighbouring ones",
                    gap));
  else if (budget.sharpness < kSoft)
    causes.emplace_back(
        kWorthwhileDb,
        fmt::format("Time: renders have {:.0f} % of the photographs' detail, on pictures that were "
                    "trained on as well. Train longer, with --time 10m",
                    100 * budget.sharpness));
  std::stable_sort(
      causes.begin(), causes.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::string> advice;
  for (auto& [gain, text] : causes) advice.push_back(std::move(text));
  return advice;
}

}  // namespace pipeline
