#include "pipeline/ingest/lens_straightening.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "io/process/progress.h"
#include "sfm/features/lens_curvature.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

// A picture of 120 degrees already spends three quarters of its pixels on what lies beyond 41 degrees.
const double kMaxTangent = std::tan(60 * std::numbers::pi / 180);
// Lenses as long as this, in longer sides of the picture, are no fisheyes: 80 degrees across.
constexpr double kMinLongFocal = 0.6;
// Compared: runs of neighbours, which overlap in videos and walks. Their features: enough for the lens.
constexpr std::size_t kRuns = 4, kRun = 4;
constexpr std::size_t kFewest = 4;  // of one camera: six pairs
// Pictures that shrink more are interpolated at twice their size first: else pixels would be skipped.
constexpr double kMinScale = 0.8;
const sfm::FeatureOptions kLooks{.max_features = 2048, .max_image_size = 800};

// Half of the pinhole picture's side [lens pixels in the middle], for half of the lens's.
double HalfSide(double curvature, double half_side, double half_diagonal) {
  const double border = half_diagonal * sfm::PinholeRadius(curvature, half_side / half_diagonal);
  return std::min(border, kMaxTangent * half_diagonal * sfm::FisheyeFocal(curvature));
}

struct Lens {
  double curvature;
  int width, height;
};

// scale: pixels of the pinhole picture per pixel of the lens's, in the middle.
io::PixelSources Sources(const Lens& lens, int width, int height, double scale) {
  const double half_diagonal = std::hypot(lens.width, lens.height) / 2;
  io::PixelSources sources(width, height);
  for (int row = 0, i = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column, ++i) {
      const double x = (column + 0.5 - width / 2.0) / scale, y = (row + 0.5 - height / 2.0) / scale;
      const double r = std::hypot(x, y) / half_diagonal;
      const double shrunk = r > 0 ? sfm::LensRadius(lens.curvature, r) / r : 1;
      sources.x[static_cast<std::size_t>(i)] = static_cast<float>(lens.width / 2.0 + x * shrunk);
      sources.y[static_cast<std::size_t>(i)] = static_cast<float>(lens.height / 2.0 + y * shrunk);
    }
  }
  return sources;
}

std::vector<KeptPicture*> Sample(const std::vector<KeptPicture*>& pictures) {
  if (pictures.size() <= kRuns * kRun) return pictures;
  std::vector<KeptPicture*> sample;
  for (std::size_t run = 0; run < kRuns; ++run) {
    const std::size_t first = run * (pictures.size() - kRun) / (kRuns - 1);
    for (std::size_t i = 0; i < kRun; ++i) sample.push_back(pictures[first + i]);
  }
  return sample;
}

sfm::LensCurvature Curvature(const fs::path& folder,
                             const std::vector<KeptPicture*>& pictures,
                             const IngestOptions& options) {
  std::vector<std::string> names;
  for (const KeptPicture* picture : Sample(pictures)) names.push_back(picture->name);
  sfm::FeatureOptions looks = kLooks;
  looks.threads = options.threads;
  looks.memory = options.memory;
  const fs::path masks = fs::exists(folder / "masks") ? folder / "masks" : fs::path();
  const std::vector<sfm::Features> features = sfm::DetectFeatures(folder / "images", names, masks, looks);
  const auto matches =
      sfm::MatchFeatures(features, sfm::AllPairs(static_cast<int>(names.size())), options.threads);
  return sfm::FindLensCurvature(features, matches, pictures[0]->width, pictures[0]->height, options.threads);
}

void Straighten(const StraightView& view, const fs::path& folder, KeptPicture* picture) {
  const fs::path image = folder / "images" / picture->name, mask = folder / "masks" / picture->name;
  if (picture->has_mask) io::WriteMask(mask, view.Of(io::ReadMask(mask, picture->width, picture->height)));
  io::WriteImage(image, view.Of(io::ReadImage(image)));
  picture->width = view.width();
  picture->height = view.height();
  picture->focal_px = view.focal_px();
}

void StraightenAll(const StraightView& view,
                   const fs::path& folder,
                   const std::vector<KeptPicture*>& pictures,
                   int threads) {
  std::mutex mutex;
  io::Progress progress("straightening");  // guarded by it, as `done` is
  std::size_t done = 0;
  io::ParallelFor(pictures.size(), threads, [&](std::size_t i) {
    io::ThrowIfInterrupted();
    Straighten(view, folder, pictures[i]);
    const std::lock_guard lock(mutex);
    progress.Update(static_cast<double>(++done) / static_cast<double>(pictures.size()), pictures[i]->name);
  });
}

}  // namespace

StraightView::StraightView(double curvature, int width, int height, int max_side) {
  const double half_diagonal = std::hypot(width, height) / 2;
  const double across = 2 * HalfSide(curvature, width / 2.0, half_diagonal),
               down = 2 * HalfSide(curvature, height / 2.0, half_diagonal);
  const double scale = std::min(1.0, max_side / std::max(across, down));
  width_ = std::max(1, static_cast<int>(across * scale));
  height_ = std::max(1, static_cast<int>(down * scale));
  focal_px_ = scale * half_diagonal * sfm::FisheyeFocal(curvature);
  samples_ = scale < kMinScale ? 2 : 1;
  const Lens lens{curvature, width, height};
  for_images_ = Sources(lens, width_ * samples_, height_ * samples_, scale * samples_);
  for_masks_ = Sources(lens, width_, height_, scale);
}

double StraightView::degrees() const { return 360 / std::numbers::pi * std::atan(width_ / (2 * focal_px_)); }

io::Image StraightView::Of(const io::Image& picture) const {
  io::Image straight = io::Resample(picture, for_images_);
  return samples_ == 1 ? straight : io::ResizeArea(straight, width_, height_);
}

io::Mask StraightView::Of(const io::Mask& mask) const { return io::Resample(mask, for_masks_); }

void StraightenLenses(const fs::path& folder, const IngestOptions& options, IngestReport* report) {
  std::map<std::tuple<int, int, int>, std::vector<KeptPicture*>> cameras;
  for (KeptPicture& picture : report->frames.kept) {
    if (!picture.is_panorama)
      cameras[{picture.camera_group, picture.width, picture.height}].push_back(&picture);
  }
  for (const auto& [key, pictures] : cameras) {
    const int width = pictures[0]->width, height = pictures[0]->height;
    if (pictures.size() < kFewest) continue;
    if (pictures[0]->focal_px.value_or(0) > kMinLongFocal * std::max(width, height)) continue;
    const sfm::LensCurvature found = Curvature(folder, pictures, options);
    if (found.curvature == 0) continue;
    const StraightView view(found.curvature, width, height, options.max_side);
    StraightenAll(view, folder, pictures, options.threads);
    report->decisions.push_back(
        fmt::format("fisheye lens or action camera: {} pictures made straight, {} x {} pixels, about {:.0f} "
                    "degrees across ({:.0f} % of the matches agree, {:.0f} % as they were)",
                    pictures.size(),
                    view.width(),
                    view.height(),
                    view.degrees(),
                    100 * found.agreeing,
                    100 * found.agreeing_pinhole));
  }
}

}  // namespace pipeline
