#include "pipeline/ingest/overlay_removal.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "pipeline/ingest/overlay.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kCompared = 30;  // pictures, spread over the capture
constexpr int kSide = 1024;            // [px] longer side at which they are compared

io::Image Cropped(const io::Image& image, const Bars& bars) {
  io::Image cropped = io::MakeImage(
      image.width - bars.left - bars.right, image.height - bars.top - bars.bottom, image.channels);
  const auto row_bytes = static_cast<std::size_t>(cropped.width * cropped.channels);
  for (int y = 0; y < cropped.height; ++y) {
    std::copy_n(image.Pixel(bars.left, bars.top + y), row_bytes, cropped.Pixel(0, y));
  }
  return cropped;
}

io::Mask Cropped(const io::Mask& mask, const Bars& bars) {
  if (mask.used.empty()) return mask;
  io::Mask cropped{mask.width - bars.left - bars.right, mask.height - bars.top - bars.bottom, {}};
  for (int y = 0; y < cropped.height; ++y) {
    const auto row = mask.used.begin() + std::ptrdiff_t{bars.top + y} * mask.width + bars.left;
    cropped.used.insert(cropped.used.end(), row, row + cropped.width);
  }
  return cropped;
}

// `overlay` has the picture's size.
void Remove(const Overlay& overlay, const fs::path& folder, KeptPicture* picture) {
  io::Mask mask = overlay.mask;
  if (picture->has_mask) {
    const io::Mask own = io::ReadMask(folder / "masks" / picture->name, picture->width, picture->height);
    if (mask.used.empty()) mask = {own.width, own.height, std::vector<std::uint8_t>(own.used.size(), 255)};
    for (std::size_t i = 0; i < own.used.size(); ++i) mask.used[i] &= own.used[i];
  }
  if (overlay.bars.Any()) {
    const io::Image cropped = Cropped(io::ReadImage(folder / "images" / picture->name), overlay.bars);
    io::WriteImage(folder / "images" / picture->name, cropped);
    picture->width = cropped.width;
    picture->height = cropped.height;
  }
  if (mask.used.empty()) return;
  fs::create_directories(folder / "masks");
  io::WriteMask(folder / "masks" / picture->name, Cropped(mask, overlay.bars));
  picture->has_mask = true;
}

void Describe(const Overlay& found, int width, int height, std::size_t n, IngestReport* report) {
  if (found.bars.Any()) {
    report->decisions.push_back(
        fmt::format("black bars around {} pictures are cut off: {} x {} pixels remain", n, width, height));
  }
  if (!found.mask.used.empty()) {
    report->decisions.push_back(
        fmt::format("{:.1f} % of {} pictures never change while the rest does, such as a date, a logo or a "
                    "part of the camera: masked out",
                    100 * found.covered,
                    n));
  }
}

}  // namespace

std::size_t OverlayRemoval::Bytes(std::size_t n_pictures, int max_side) {
  const auto side = static_cast<std::size_t>(std::min(max_side, kSide));
  return std::min(n_pictures, kCompared) * 3 * side * side;
}

void OverlayRemoval::Look(std::size_t index, const std::string& name, const io::Image& picture) {
  // The first picture of each of kCompared equal parts.
  const bool is_compared = index * kCompared % n_pictures_ < kCompared;
  // Transparency says itself what does not count.
  if (!is_compared || picture.channels != 3) return;
  const double scale = std::min(1.0, static_cast<double>(kSide) / std::max(picture.width, picture.height));
  io::Image small = io::ResizeArea(picture,
                                   std::max(1, static_cast<int>(picture.width * scale)),
                                   std::max(1, static_cast<int>(picture.height * scale)));
  const std::lock_guard lock(mutex_);
  looks_.emplace(name, std::move(small));
}

void OverlayRemoval::Apply(const fs::path& folder, int threads, IngestReport* report) const {
  std::map<std::pair<int, int>, std::vector<KeptPicture*>> sizes;
  for (KeptPicture& picture : report->frames.kept) sizes[{picture.width, picture.height}].push_back(&picture);
  for (const auto& entry : sizes) {
    const auto [width, height] = entry.first;
    const std::vector<KeptPicture*>& pictures = entry.second;
    std::vector<io::Image> looks;
    for (const KeptPicture* picture : pictures) {
      const auto look = looks_.find(picture->name);
      if (look != looks_.end()) looks.push_back(look->second);
    }
    const Overlay found = FindOverlay(looks, threads);
    if (!found.bars.Any() && found.mask.used.empty()) continue;
    const Overlay overlay = ResizedOverlay(found, looks[0].width, looks[0].height, width, height);
    io::ParallelFor(pictures.size(), threads, [&](std::size_t i) {
      io::ThrowIfInterrupted();
      Remove(overlay, folder, pictures[i]);
    });
    Describe(found, pictures[0]->width, pictures[0]->height, pictures.size(), report);
  }
}

}  // namespace pipeline
