#include "pipeline/ingest/panorama.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <mutex>
#include <numbers>
#include <utility>

#include "io/base/natural_order.h"
#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "io/process/progress.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

constexpr double kRadians = std::numbers::pi / 180;
const double kHalfWidth = std::tan(40 * kRadians), kHalfHeight = std::tan(50 * kRadians);

// The size at which panoramas are told from other pictures.
constexpr int kLookWidth = 256, kLookHeight = 128;
// Across the seam of a panorama the picture changes as from any column to the next; of photos that are twice
// as wide as high, 4 to 20 times as much.
constexpr double kMaxSeam = 2;
// Spread of the upper row, of the whole picture's: in panoramas that row is one point of the sky or ceiling.
constexpr double kMaxPoleSpread = 0.3;
// Spread of the left column, below which it is as plain as a studio's backdrop.
constexpr double kMinBorderSpread = 0.3;
constexpr int kRounding = 2;  // of the sides, in pictures that were made smaller
// Columns that interpolation reaches beyond a border.
constexpr int kSeamReach = 8;

// Grey levels of a column, a row, or all.
struct Spread {
  double sum = 0, squares = 0, n = 0;
  void Add(double value) { sum += value, squares += value * value, ++n; }
  double Deviation() const { return std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n))); }
};

// The columns from `first` on, which may lie beyond the borders of what is periodic.
io::Image Turned(const io::Image& panorama, int first, int width) {
  io::Image turned = io::MakeImage(width, panorama.height, panorama.channels);
  for (int y = 0; y < panorama.height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int from = ((first + x) % panorama.width + panorama.width) % panorama.width;
      std::copy_n(panorama.Pixel(from, y), panorama.channels, turned.Pixel(x, y));
    }
  }
  return turned;
}

io::Image AsImage(const io::Mask& mask) {
  io::Image image = io::MakeImage(mask.width, mask.height, 3);
  for (std::size_t i = 0; i < mask.used.size(); ++i) std::fill_n(&image.data[3 * i], 3, mask.used[i]);
  return image;
}

// Of one panorama: its views, and what becomes of its entry.
std::vector<KeptPicture> Unroll(const PanoramaViews& views,
                                const fs::path& folder,
                                const KeptPicture& panorama) {
  const fs::path image_path = folder / "images" / panorama.name, mask_path = folder / "masks" / panorama.name;
  const io::Image image = io::ReadImage(image_path);
  std::vector<KeptPicture> unrolled;
  for (int i = 0; i < PanoramaViews::kCount; ++i) {
    KeptPicture view = panorama;
    view.is_panorama = false;
    view.name = fmt::format("view{}_{}", i + 1, panorama.name);
    while (fs::exists(folder / "images" / view.name)) view.name.insert(0, "_");
    view.source = fmt::format("{}, view {}", panorama.source, i + 1);
    view.panorama = panorama.name;
    view.heading_deg = 360.0 * i / PanoramaViews::kCount;
    view.width = views.width();
    view.height = views.height();
    view.focal_px = views.focal_px();
    if (panorama.has_mask) {
      const io::Mask used = views.Of(io::ReadMask(mask_path, panorama.width, panorama.height), i);
      if (used.UsedCount() == 0) continue;
      io::WriteMask(folder / "masks" / view.name, used);
    }
    io::WriteImage(folder / "images" / view.name, views.Of(image, i));
    unrolled.push_back(std::move(view));
  }
  fs::remove(image_path);
  fs::remove(mask_path);
  return unrolled;
}

}  // namespace

bool IsPanorama(const io::Image& picture) {
  const bool has_shape = std::abs(picture.width - 2 * picture.height) <= kRounding;
  if (!has_shape || picture.width < kLookWidth || picture.channels != 3) return false;
  const io::Image look = io::ResizeArea(picture, kLookWidth, kLookHeight);
  Spread all, top, left;
  double seam = 0, inside = 0;
  for (int y = 0; y < kLookHeight; ++y) {
    for (int x = 0; x < kLookWidth; ++x) {
      const int value = look.Pixel(x, y)[1], next = look.Pixel((x + 1) % kLookWidth, y)[1];
      all.Add(value);
      if (y == 0) top.Add(value);
      if (x == 0) left.Add(value);
      (x + 1 < kLookWidth ? inside : seam) += std::abs(next - value);
    }
  }
  inside /= kLookWidth - 1;
  const double spread = all.Deviation();
  return spread > 0 && seam <= kMaxSeam * inside && top.Deviation() <= kMaxPoleSpread * spread &&
         left.Deviation() >= kMinBorderSpread * spread;
}

int PanoramaWidth(int max_side) {
  return 2 * static_cast<int>(std::ceil(max_side * std::numbers::pi / (2 * kHalfHeight)));
}

PanoramaViews::PanoramaViews(int panorama_width, int panorama_height, int max_side)
    : focal_px_(std::min(panorama_width / (2 * std::numbers::pi), max_side / (2 * kHalfHeight))),
      panorama_width_(panorama_width) {
  width_ = static_cast<int>(2 * kHalfWidth * focal_px_);
  height_ = static_cast<int>(2 * kHalfHeight * focal_px_);
  sources_ = io::PixelSources(width_, height_);
  const double per_radian = panorama_width / (2 * std::numbers::pi);
  half_columns_ = static_cast<int>(std::ceil(per_radian * std::atan(kHalfWidth))) + kSeamReach;
  for (int row = 0, i = 0; row < height_; ++row) {
    for (int column = 0; column < width_; ++column, ++i) {
      const double x = (column + 0.5 - width_ / 2.0) / focal_px_, y = (row + 0.5 - height_ / 2.0) / focal_px_;
      sources_.x[static_cast<std::size_t>(i)] = static_cast<float>(half_columns_ + per_radian * std::atan(x));
      sources_.y[static_cast<std::size_t>(i)] =
          static_cast<float>(panorama_height / 2.0 + per_radian * std::atan(y / std::hypot(1, x)));
    }
  }
}

io::Image PanoramaViews::Of(const io::Image& panorama, int i) const {
  return io::Resample(
      Turned(panorama, panorama_width_ / 2 + panorama_width_ * i / kCount - half_columns_, 2 * half_columns_),
      sources_);
}

io::Mask PanoramaViews::Of(const io::Mask& mask, int i) const {
  return io::MaskFromImage(Of(AsImage(mask), i));
}

void UnrollPanoramas(const fs::path& folder, const IngestOptions& options, IngestReport* report) {
  std::vector<KeptPicture> panoramas;
  std::erase_if(report->frames.kept, [&](KeptPicture& picture) {
    if (picture.is_panorama) panoramas.push_back(picture);
    return picture.is_panorama;
  });
  if (panoramas.empty()) return;
  std::vector<std::vector<KeptPicture>> unrolled(panoramas.size());
  std::mutex mutex;
  io::Progress progress("unrolling panoramas");  // guarded by it, as `done` is
  std::size_t done = 0;
  io::ParallelFor(panoramas.size(), options.threads, [&](std::size_t i) {
    io::ThrowIfInterrupted();
    const PanoramaViews views(panoramas[i].width, panoramas[i].height, options.max_side);
    unrolled[i] = Unroll(views, folder, panoramas[i]);
    const std::lock_guard lock(mutex);
    progress.Update(static_cast<double>(++done) / static_cast<double>(panoramas.size()), panoramas[i].name);
  });
  std::size_t n_views = 0;
  for (std::vector<KeptPicture>& views : unrolled) {
    n_views += views.size();
    std::move(views.begin(), views.end(), std::back_inserter(report->frames.kept));
  }
  std::sort(report->frames.kept.begin(),
            report->frames.kept.end(),
            [](const KeptPicture& a, const KeptPicture& b) { return io::NaturalLess(a.name, b.name); });
  report->decisions.push_back(
      fmt::format("{} panoramas of 360 degrees: {} views of 80 x 100 degrees around the horizon take their "
                  "places",
                  panoramas.size(),
                  n_views));
}

}  // namespace pipeline
