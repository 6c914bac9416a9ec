#include "pipeline/stages/evaluation.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/interrupt.h"
#include "io/base/parallel.h"
#include "io/base/progress.h"
#include "io/base/quoting.h"
#include "io/image/colour_map.h"
#include "io/image/mask.h"
#include "nerf/metrics/flip.h"
#include "nerf/metrics/metrics.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr std::uint8_t kWhite = 255;
constexpr std::uint8_t kDarkening = 4;  // unused pixels of a strip: dark, but one sees what was there

fs::path RenderPath(const fs::path& folder, const io::Frame& frame) {
  return folder / "renders" / (frame.image_path.stem().string() + ".png");
}

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

io::Image ReadTruth(const io::Frame& frame) {
  return io::CompositeOn(io::ReadImage(frame.image_path), kWhite);
}

void Paste(const io::Image& picture, int x, io::Image* strip) {
  for (int y = 0; y < picture.height; ++y) {
    std::copy_n(picture.Pixel(0, y), 3 * picture.width, strip->Pixel(x, y));
  }
}

io::Mask MaskOf(const io::Frame& frame, const io::Image& truth) {
  return frame.mask_path.empty() ? io::Mask() : io::ReadMask(frame.mask_path, truth.width, truth.height);
}

io::Image DarkenUnused(io::Image picture, const io::Mask& mask) {
  for (std::size_t i = 0; i < picture.data.size(); ++i) {
    if (!mask.Uses(i / 3)) picture.data[i] /= kDarkening;
  }
  return picture;
}

io::Image MakeStrip(const io::Image& truth, const io::Image& render, const io::Mask& mask) {
  const nerf::FlipMap flip = nerf::Flip(truth, render);
  const int step = truth.width + kStripGap;
  io::Image strip = io::MakeImage(3 * step - kStripGap, truth.height, 3);
  std::fill(strip.data.begin(), strip.data.end(), kWhite);
  const io::Image error = io::ApplyColourMap(flip.error, flip.width, flip.height, io::ColourMap::kMagma);
  Paste(DarkenUnused(truth, mask), 0, &strip);
  Paste(DarkenUnused(render, mask), step, &strip);
  Paste(DarkenUnused(error, mask), 2 * step, &strip);
  return strip;
}

ViewScore ScoreView(const io::Frame& frame, const fs::path& render_path) {
  if (!fs::is_regular_file(render_path)) {
    throw Error(ExitCode::kBadInput, render_path.string() + ": the render of a held-out view is missing");
  }
  const io::Image truth = ReadTruth(frame), render = io::ReadImage(render_path);
  if (truth.width != render.width || truth.height != render.height) {
    throw Error(ExitCode::kBadInput,
                render_path.string() + ": " + SizeText(render.width, render.height) +
                    " pixels, its truth has " + SizeText(truth.width, truth.height));
  }
  const io::Mask mask = MaskOf(frame, truth);
  ViewScore score;
  score.name = frame.image_path.filename().string();
  score.mse = nerf::MeanSquaredError(truth, render, mask);
  score.identical = score.mse == 0;
  score.psnr_db = nerf::PsnrFromMse(score.mse);
  score.ssim = nerf::Ssim(truth, render, mask);
  score.flip = nerf::Flip(truth, render, {}, mask).mean;
  return score;
}

}  // namespace

std::vector<int> Evaluation::WorstFirst() const {
  std::vector<int> order(views.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(
      order.begin(), order.end(), [&](int a, int b) { return views[a].psnr_db < views[b].psnr_db; });
  return order;
}

io::Image QuantizeView(const nerf::RenderedView& view) {
  io::Image image = io::MakeImage(view.width, view.height, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    if (!std::isfinite(view.rgb[i])) {
      const std::size_t pixel = i / 3;
      throw Error(ExitCode::kBadInput,
                  "the render is not finite at pixel (" + std::to_string(pixel % view.width) + ", " +
                      std::to_string(pixel / view.width) + ")",
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
  io::Progress progress("evaluate: render");
  std::set<std::string> stems;
  for (std::size_t i = 0; i < test.frames.size(); ++i) {
    io::ThrowIfInterrupted();
    const io::Frame& frame = test.frames[i];
    if (!stems.insert(frame.image_path.stem().string()).second) {
      throw Error(ExitCode::kBadInput,
                  frame.image_path.string() + ": another held-out picture has the same name",
                  "Give each picture a name of its own");
    }
    const fs::path path = RenderPath(folder, frame);
    const io::Camera& camera = test.cameras[frame.camera_index];
    if (camera.HasDistortion()) {
      throw Error(ExitCode::kBadInput,
                  frame.image_path.string() + ": its camera is distorted",
                  "Run pipeline normalize, which undistorts");
    }
    if (!fs::is_regular_file(path)) {
      const io::Image truth = io::ReadImage(frame.image_path);
      if (truth.width != camera.width || truth.height != camera.height) {
        throw Error(ExitCode::kBadInput,
                    frame.image_path.string() + ": " + SizeText(truth.width, truth.height) +
                        " pixels, its camera has " + SizeText(camera.width, camera.height));
      }
      nerf::RenderOptions options;
      options.threads = threads;
      io::WriteImage(path, QuantizeView(field.Render(camera, frame.world_from_cam, options)));
    }
    progress.Update(static_cast<double>(i + 1) / static_cast<double>(test.frames.size()));
  }
}

Evaluation ScoreViews(const io::Scene& test, const fs::path& folder, const EvaluationOptions& options) {
  const int n = static_cast<int>(test.frames.size());
  if (n == 0) throw Error(ExitCode::kBadInput, "no held-out view to score", "Run pipeline normalize again");
  Evaluation result;
  const io::Image first = io::ReadImage(test.frames[0].image_path);
  result.width = first.width;
  result.height = first.height;
  result.white_background = first.channels == 4;
  result.masked = std::any_of(test.frames.begin(), test.frames.end(), [](const io::Frame& frame) {
    return !frame.mask_path.empty();
  });
  result.views.resize(test.frames.size());
  io::Workers workers(options.threads);
  io::Progress progress("evaluate: score");
  std::atomic<int> done = 0;
  workers.Run(n, [&](int i, int thread) {
    io::ThrowIfInterrupted();
    result.views[i] = ScoreView(test.frames[i], RenderPath(folder, test.frames[i]));
    ++done;
    if (thread == 0) progress.Update(static_cast<double>(done) / n);
  });

  double mse = 0;
  for (const ViewScore& view : result.views) {
    result.psnr_db += view.psnr_db / n;
    result.ssim += view.ssim / n;
    result.flip += view.flip / n;
    mse += view.mse / n;
  }
  result.psnr_of_mean_mse_db = nerf::PsnrFromMse(mse);

  fs::remove_all(folder / "compare");
  fs::create_directories(folder / "compare");
  const std::vector<int> order = result.WorstFirst();
  workers.Run(std::min(n, options.max_strips), [&](int rank, int) {
    const io::Frame& frame = test.frames[order[rank]];
    char prefix[16];
    std::snprintf(prefix, sizeof prefix, n < 100 ? "%02d_" : "%03d_", rank + 1);
    const io::Image truth = ReadTruth(frame), render = io::ReadImage(RenderPath(folder, frame));
    io::WriteImage(folder / "compare" / (prefix + frame.image_path.stem().string() + ".png"),
                   MakeStrip(truth, render, MaskOf(frame, truth)));
  });
  return result;
}

void WriteScores(const Evaluation& evaluation, const std::string& protocol, const fs::path& folder) {
  Json json;
  json["protocol"] = protocol;
  json["resolution"] = {evaluation.width, evaluation.height};
  json["background"] =
      evaluation.white_background ? "white, straight alpha composited before scoring" : "none";
  if (evaluation.masked) {
    json["masked"] = true;
    json["pixels"] = "those that the masks use; of SSIM and FLIP, values at their place";
  }
  json["rounding"] = "8-bit sRGB, nearest, both pictures";
  json["ssim_kernel"] =
      "11x11 Gaussian, sigma 1.5, valid region, mean of channels, k1 0.01, k2 0.03, data range 1";
  json["flip_pixels_per_degree"] = nerf::FlipOptions().pixels_per_degree;
  json["psnr_cap_db"] = nerf::kMaxPsnrDb;
  json["psnr"] = evaluation.psnr_db;
  json["ssim"] = evaluation.ssim;
  json["flip"] = evaluation.flip;
  json["psnr_of_mean_mse"] = evaluation.psnr_of_mean_mse_db;
  std::string csv = "name,psnr,ssim,flip\n";
  for (const ViewScore& view : evaluation.views) {
    Json entry = {{"name", view.name}, {"psnr", view.psnr_db}, {"ssim", view.ssim}, {"flip", view.flip}};
    if (view.identical) entry["identical"] = true;
    json["images"].push_back(entry);
    char numbers[96];
    std::snprintf(numbers, sizeof numbers, ",%.4f,%.6f,%.6f\n", view.psnr_db, view.ssim, view.flip);
    csv += io::CsvQuoted(view.name) + numbers;
  }
  io::WriteFileAtomically(folder / "metrics.json",
                          json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  io::WriteFileAtomically(folder / "per_image.csv", csv);
}

}  // namespace pipeline
