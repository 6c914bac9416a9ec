#include "nerf/data/plain_background.h"
#include "io/base/median.h"

#include <algorithm>
#include <cstdlib>

namespace nerf {
namespace {

constexpr double kMinShare = 0.98;
// Of the pixels on the borders, so many must be used: masks that leave hardly any hide the background.
constexpr double kMinUsed = 0.5;
constexpr int kTolerance = 2;
constexpr std::uint8_t kMixed = 128, kOpaque = 255;

using Colour = std::array<std::uint8_t, 3>;

bool IsAlike(const std::uint8_t* pixel, const Colour& colour) {
  for (std::size_t j = 0; j < 3; ++j) {
    if (std::abs(pixel[j] - colour[j]) > kTolerance) return false;
  }
  return true;
}

// The used pixels on the border of a view, counted from its first.
std::vector<std::size_t> BorderPixels(const View& view, const std::vector<bool>& used) {
  std::vector<std::size_t> pixels;
  const auto width = static_cast<std::size_t>(view.width), height = static_cast<std::size_t>(view.height);
  for (std::size_t y = 0; y < height; ++y) {
    const bool is_whole_row = y == 0 || y + 1 == height;
    for (std::size_t x = 0; x < width; x += is_whole_row || width == 1 ? 1 : width - 1) {
      if (used.empty() || used[view.first_pixel + y * width + x]) pixels.push_back(y * width + x);
    }
  }
  return pixels;
}

// The one colour of the border pixels; false when there is none.
bool ColourOf(const Dataset& dataset, const std::vector<std::size_t>& border, Colour* colour) {
  if (border.empty()) return false;
  for (std::size_t j = 0; j < 3; ++j) {
    std::vector<std::uint8_t> values;
    for (const std::size_t pixel : border) values.push_back(dataset.pixels[3 * pixel + j]);
    (*colour)[j] = io::Median(std::move(values));
  }
  const auto n_alike = std::count_if(border.begin(), border.end(), [&](std::size_t pixel) {
    return IsAlike(&dataset.pixels[3 * pixel], *colour);
  });
  return static_cast<double>(n_alike) >= kMinShare * static_cast<double>(border.size());
}

// Alpha of one view's pixels, for which `seeds` are on its border. used: of all views, or empty.
std::vector<std::uint8_t> AlphaOf(const std::vector<std::size_t>& seeds,
                                  const std::uint8_t* rgb,
                                  const View& view,
                                  const std::vector<bool>& used,
                                  const Colour& colour) {
  const auto width = static_cast<std::size_t>(view.width), height = static_cast<std::size_t>(view.height);
  std::vector<std::uint8_t> alpha(width * height, kOpaque);
  for (std::size_t pixel = 0; pixel < alpha.size(); ++pixel) {
    if (!IsAlike(rgb + 3 * pixel, colour)) continue;
    const std::size_t x = pixel % width, y = pixel / width;
    for (std::size_t v = y - (y > 0); v <= std::min(y + 1, height - 1); ++v) {
      for (std::size_t u = x - (x > 0); u <= std::min(x + 1, width - 1); ++u) alpha[v * width + u] = kMixed;
    }
  }
  std::vector<std::size_t> open;
  const auto visit = [&](std::size_t pixel) {
    if (!used.empty() && !used[view.first_pixel + pixel]) return;
    if (alpha[pixel] == 0 || !IsAlike(rgb + 3 * pixel, colour)) return;
    alpha[pixel] = 0;
    open.push_back(pixel);
  };
  for (const std::size_t pixel : seeds) visit(pixel);
  while (!open.empty()) {
    const std::size_t pixel = open.back(), x = pixel % width, y = pixel / width;
    open.pop_back();
    if (x > 0) visit(pixel - 1);
    if (x + 1 < width) visit(pixel + 1);
    if (y > 0) visit(pixel - width);
    if (y + 1 < height) visit(pixel + width);
  }
  return alpha;
}

}  // namespace

void MarkPlainBackground(Dataset* dataset, const io::MemoryBudget& memory) {
  if (dataset->channels != 3) return;
  const std::vector<bool> used = dataset->UsedPixels();
  std::vector<std::vector<std::size_t>> borders;
  std::vector<std::size_t> all;
  std::size_t n_border = 0;
  for (const View& view : dataset->views) {
    n_border += BorderPixels(view, {}).size();
    borders.push_back(BorderPixels(view, used));
    for (const std::size_t pixel : borders.back()) all.push_back(view.first_pixel + pixel);
  }
  Colour colour;
  if (static_cast<double>(all.size()) < kMinUsed * static_cast<double>(n_border)) return;
  if (!ColourOf(*dataset, all, &colour)) return;
  memory.Require(4 * dataset->n_pixels(), "telling objects from their plain background");
  // In place and from the end, where each pixel moves to beyond those that are still to move.
  std::vector<std::uint8_t>& pixels = dataset->pixels;
  pixels.reserve(dataset->n_pixels() * 4);  // and no more, as resizing alone would
  pixels.resize(dataset->n_pixels() * 4);
  for (std::size_t v = dataset->views.size(); v-- > 0;) {
    const View& view = dataset->views[v];
    const std::uint8_t* rgb = &pixels[3 * view.first_pixel];
    const std::vector<std::uint8_t> alpha = AlphaOf(borders[v], rgb, view, used, colour);
    for (std::size_t pixel = alpha.size(); pixel-- > 0;) {
      const std::array<std::uint8_t, 4> rgba = {
          rgb[3 * pixel], rgb[3 * pixel + 1], rgb[3 * pixel + 2], alpha[pixel]};
      std::copy(rgba.begin(), rgba.end(), &pixels[4 * (view.first_pixel + pixel)]);
    }
  }
  dataset->channels = 4;
  dataset->background.emplace();
  for (std::size_t j = 0; j < 3; ++j) (*dataset->background)[j] = static_cast<float>(colour[j]) / 255.f;
}

}  // namespace nerf
