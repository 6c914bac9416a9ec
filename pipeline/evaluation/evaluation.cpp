#include "pipeline/evaluation/evaluation.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <set>

#include "io/base/error.h"
#include "io/base/median.h"
#include "io/base/quoting.h"
#include "io/image/colour_map.h"
#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "io/process/progress.h"
#include "io/process/ranks.h"
#include "nerf/metrics/flip.h"
#include "nerf/metrics/metrics.h"
#include "nerf/rendering/hidden_points.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
namespace fs = std::filesystem;

constexpr std::uint8_t kWhite = 255;
constexpr double kNoShare = -1;         // of a view without sparse points
constexpr std::uint8_t kDarkening = 4;  // of pixels that a mask leaves out
// Of a pixel whose view is scored: FLIP and SSIM filter both pictures in double.
constexpr std::size_t kScoringBytes = 320;

fs::path RenderPath(const fs::path& folder, const io::Frame& frame) {
  return folder / "renders" / (frame.image_path.stem().string() + ".png");
}

std::string SizeText(int width, int height) { return fmt::format("{}x{}", width, height); }

void WriteComparison(const io::Frame& frame, const fs::path& render_path, const Comparison& paths) {
  const auto [truth, mask] = ReadTruth(frame);
  const io::Image render = io::ReadImage(render_path);
  const nerf::FlipMap flip = nerf::Flip(truth, render);
  const io::Image error = io::ApplyColourMap(flip.error, flip.width, flip.height, io::ColourMap::kMagma);
  io::WriteImage(paths.photo, DarkenUnused(truth, mask));
  io::WriteImage(paths.render, DarkenUnused(render, mask));
  io::WriteImage(paths.error, DarkenUnused(error, mask));
}

// Of the picture against its own mean colour.
double PlainPsnr(const io::Image& truth, const io::Mask& mask) {
  double sum[3] = {0, 0, 0}, n = 0;
  const std::size_t n_pixels = truth.data.size() / 3;
  for (std::size_t i = 0; i < n_pixels; ++i) {
    if (!mask.Uses(i)) continue;
    n += 1;
    for (std::size_t c = 0; c < 3; ++c) sum[c] += truth.data[3 * i + c];
  }
  io::Image plain = truth;
  for (std::size_t i = 0; i < plain.data.size(); ++i)
    plain.data[i] = static_cast<std::uint8_t>(std::lround(sum[i % 3] / std::max(n, 1.0)));
  return nerf::PsnrFromMse(nerf::MeanSquaredError(truth, plain, mask));
}

// What ranks tell one another of a view.
struct ViewFigures {
  double mse = 0, psnr_db = 0, aligned_psnr_db = 0, ssim = 0, flip = 0, plain_psnr_db = 0;
};

ViewFigures ScoreView(const io::Frame& frame, const fs::path& render_path) {
  if (!fs::is_regular_file(render_path)) {
    throw Error(ExitCode::kBadInput, render_path.string() + ": the render of a held-out view is missing");
  }
  const auto [truth, mask] = ReadTruth(frame);
  const io::Image render = io::ReadImage(render_path);
  if (truth.width != render.width || truth.height != render.height) {
    throw Error(ExitCode::kBadInput,
                render_path.string() + ": " + SizeText(render.width, render.height) +
                    " pixels, its truth has " + SizeText(truth.width, truth.height));
  }
  const double mse = nerf::MeanSquaredError(truth, render, mask);
  return {.mse = mse,
          .psnr_db = nerf::PsnrFromMse(mse),
          .aligned_psnr_db = nerf::PsnrFromMse(nerf::ColourAlignedError(truth, render, mask)),
          .ssim = nerf::Ssim(truth, render, mask),
          .flip = nerf::Flip(truth, render, {}, mask).mean,
          .plain_psnr_db = PlainPsnr(truth, mask)};
}

// Keeps a render that is there.
void RenderOne(const nerf::TrainedField& field,
               const io::Scene& test,
               const io::Frame& frame,
               const fs::path& path,
               int threads) {
  const io::Camera& camera = test.cameras[static_cast<std::size_t>(frame.camera_index)];
  if (camera.HasDistortion()) {
    throw Error(ExitCode::kBadInput,
                frame.image_path.string() + ": its camera is distorted",
                "Run pipeline normalize, which undistorts");
  }
  if (fs::is_regular_file(path)) return;
  const io::Image truth = io::ReadImage(frame.image_path);
  if (truth.width != camera.width || truth.height != camera.height) {
    throw Error(ExitCode::kBadInput,
                frame.image_path.string() + ": " + SizeText(truth.width, truth.height) +
                    " pixels, its camera has " + SizeText(camera.width, camera.height));
  }
  io::WriteImage(path,
                 QuantizeView(field.Render(camera, frame.world_from_cam, OptionsOfScored(camera, threads))));
}

std::vector<ViewFigures> ScoreAll(const io::Scene& test, const fs::path& folder, io::Workers* workers) {
  std::vector<ViewFigures> figures(test.frames.size());
  const std::vector<std::size_t> own = io::OwnTasks(figures.size());
  io::Progress progress("evaluate: score");
  std::atomic<int> done = 0;
  workers->Run(static_cast<int>(own.size()), [&](int k, int thread) {
    io::ThrowIfInterrupted();
    const std::size_t view = own[static_cast<std::size_t>(k)];
    const io::Frame& frame = test.frames[view];
    figures[view] = ScoreView(frame, RenderPath(folder, frame));
    ++done;
    if (thread == 0) progress.Update(static_cast<double>(done) / static_cast<double>(own.size()));
  });
  io::GatherTasks(&figures);
  return figures;
}

void AddFigures(const io::Scene& test, const std::vector<ViewFigures>& figures, Scores* scores) {
  const int n = static_cast<int>(figures.size());
  std::vector<double> plain;
  double mean_mse = 0;
  for (std::size_t i = 0; i < figures.size(); ++i) {
    const ViewFigures& view = figures[i];
    scores->views.push_back({.name = test.frames[i].image_path.filename().string(),
                             .psnr_db = view.psnr_db,
                             .ssim = view.ssim,
                             .flip = view.flip,
                             .aligned_psnr_db = view.aligned_psnr_db,
                             .identical = view.mse == 0,
                             .budget = {}});
    scores->psnr_db += view.psnr_db / n;
    scores->ssim += view.ssim / n;
    scores->flip += view.flip / n;
    scores->aligned_psnr_db += view.aligned_psnr_db / n;
    mean_mse += view.mse / n;
    plain.push_back(view.plain_psnr_db);
  }
  scores->psnr_of_mean_mse_db = nerf::PsnrFromMse(mean_mse);
  scores->plain_psnr_db = io::Median(std::move(plain));
}

void WriteComparisons(const io::Scene& test,
                      const fs::path& folder,
                      int max_strips,
                      const Scores& scores,
                      io::Workers* workers) {
  const int n = static_cast<int>(test.frames.size());
  const std::vector<std::size_t> order = scores.WorstFirst();
  if (io::AllRanks().IsFirst()) {
    fs::remove_all(folder / "compare");
    fs::create_directories(folder / "compare");
  }
  std::vector<char> written(static_cast<std::size_t>(std::min(n, max_strips)), 0);
  io::FromFirst(true);  // the folder is there
  const std::vector<std::size_t> own = io::OwnTasks(written.size());
  workers->Run(static_cast<int>(own.size()), [&](int k, int) {
    const std::size_t place = own[static_cast<std::size_t>(k)], view = order[place];
    WriteComparison(test.frames[view],
                    RenderPath(folder, test.frames[view]),
                    ComparisonPaths(folder, static_cast<int>(place) + 1, n, scores.views[view].name));
  });
  io::GatherTasks(&written);
}

}  // namespace

io::Image DarkenUnused(io::Image picture, const io::Mask& mask) {
  for (std::size_t i = 0; i < picture.data.size(); ++i) {
    if (!mask.Uses(i / 3)) picture.data[i] /= kDarkening;
  }
  return picture;
}

Truth ReadTruth(const io::Frame& frame) {
  Truth truth{io::CompositeOn(io::ReadImage(frame.image_path), kWhite), {}};
  if (!frame.mask_path.empty())
    truth.mask = io::ReadMask(frame.mask_path, truth.picture.width, truth.picture.height);
  return truth;
}

nerf::RenderOptions OptionsOfScored(const io::Camera& camera, int threads) {
  return {.threads = threads, .field_focal_px = nerf::kFieldPictureShare * camera.fl_x};
}

io::Image QuantizeView(const nerf::RenderedView& view) {
  io::Image image = io::MakeImage(view.width, view.height, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    if (!std::isfinite(view.rgb[i])) {
      const int pixel = static_cast<int>(i / 3);
      throw Error(
          ExitCode::kBadInput,
          fmt::format("the render is not finite at pixel ({}, {})", pixel % view.width, pixel / view.width),
          "The checkpoint is unusable: train again");
    }
    image.data[i] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(view.rgb[i], 0.f, 1.f)));
  }
  return image;
}

void RenderViews(const nerf::TrainedField& field,
                 const io::Scene& test,
                 const fs::path& folder,
                 int threads) {
  fs::create_directories(folder / "renders");
  std::set<std::string> stems;
  for (const io::Frame& frame : test.frames) {
    if (!stems.insert(frame.image_path.stem().string()).second) {
      throw Error(ExitCode::kBadInput,
                  frame.image_path.string() + ": another held-out picture has the same name",
                  "Give each picture a name of its own");
    }
  }
  io::Progress progress("evaluate: render");
  std::vector<char> done(test.frames.size(), 0);
  const std::vector<std::size_t> own = io::OwnTasks(done.size());
  for (const std::size_t i : own) {
    io::ThrowIfInterrupted();
    RenderOne(field, test, test.frames[i], RenderPath(folder, test.frames[i]), threads);
    done[i] = 1;
    progress.Update(static_cast<double>(i + 1) / static_cast<double>(done.size()));
  }
  io::GatherTasks(&done);
}

std::optional<double> TrainingPsnr(const nerf::TrainedField& field, const io::Scene& train, int threads) {
  const std::size_t n = train.frames.size();
  const std::size_t n_judged = std::min(n, static_cast<std::size_t>(kJudgedTrainingViews));
  std::vector<double> psnr(n_judged);
  for (const std::size_t i : io::OwnTasks(n_judged)) {
    io::ThrowIfInterrupted();
    const io::Frame& frame = train.frames[i * n / n_judged];
    const io::Camera& camera = train.cameras[static_cast<std::size_t>(frame.camera_index)];
    const auto [truth, mask] = ReadTruth(frame);
    const io::Image render =
        QuantizeView(field.Render(camera, frame.world_from_cam, OptionsOfScored(camera, threads)));
    psnr[i] = nerf::PsnrFromMse(nerf::MeanSquaredError(truth, render, mask));
  }
  io::GatherTasks(&psnr);
  if (psnr.empty()) return std::nullopt;
  return io::Median(std::move(psnr));
}

std::optional<double> HiddenPoints(const nerf::TrainedField& field,
                                   const io::Scene& train,
                                   const io::Scene& test,
                                   int threads) {
  const std::size_t n = test.frames.size();
  const std::size_t n_judged = std::min(n, static_cast<std::size_t>(kJudgedViews));
  std::vector<double> shares(n_judged, kNoShare);
  for (const std::size_t i : io::OwnTasks(n_judged)) {
    io::ThrowIfInterrupted();
    const io::Frame& frame = test.frames[i * n / n_judged];
    const io::Camera& camera = test.cameras[static_cast<std::size_t>(frame.camera_index)];
    shares[i] =
        nerf::HiddenPointShare(field, camera, frame.world_from_cam, train, threads).value_or(kNoShare);
  }
  io::GatherTasks(&shares);
  std::erase(shares, kNoShare);
  if (shares.empty()) return std::nullopt;
  return io::Median(std::move(shares));
}

Comparison ComparisonPaths(const fs::path& folder, int rank, int n_views, const std::string& name) {
  const std::string start =
      fmt::format("{:0{}}_{}_", rank, n_views < 100 ? 2 : 3, fs::path(name).stem().string());
  const auto path = [&](const char* what) { return folder / "compare" / (start + what + ".png"); };
  return {path("photo"), path("render"), path("error")};
}

Scores ScoreViews(const io::Scene& test, const fs::path& folder, const EvaluationOptions& options) {
  const int n = static_cast<int>(test.frames.size());
  if (n == 0) throw Error(ExitCode::kBadInput, "no held-out view to score", "Run pipeline normalize again");
  Scores result;
  const io::Image first = io::ReadImage(test.frames[0].image_path);
  result.width = first.width;
  result.height = first.height;
  result.white_background = first.channels == 4;
  result.masked = std::any_of(test.frames.begin(), test.frames.end(), [](const io::Frame& frame) {
    return !frame.mask_path.empty();
  });
  const std::size_t n_pixels =
      static_cast<std::size_t>(result.width) * static_cast<std::size_t>(result.height);
  io::Workers workers(
      options.memory.AtOnce(options.threads, kScoringBytes * n_pixels, 0, "evaluate: scoring a view"));
  const std::vector<ViewFigures> figures = ScoreAll(test, folder, &workers);
  AddFigures(test, figures, &result);
  WriteComparisons(test, folder, options.max_strips, result, &workers);
  return result;
}

}  // namespace pipeline
