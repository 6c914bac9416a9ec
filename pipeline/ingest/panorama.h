// Panoramas of a 360-degree camera (equirectangular: longitude across, latitude down), and the views of
// pinhole cameras that stand for them in all stages behind.
#pragma once

#include <filesystem>
#include <vector>

#include "io/image/image.h"
#include "io/image/mask.h"
#include "io/image/resample.h"
#include "pipeline/ingest/ingest.h"

namespace pipeline {

// Whether a picture is twice as wide as high, goes on from its right border to its left one, and shows one
// point along its whole upper border, as panoramas do. Plain borders say nothing.
bool IsPanorama(const io::Image& picture);

// The width of a panorama whose views have a longer side of max_side.
int PanoramaWidth(int max_side);

// Six views around the horizon, from the panorama's middle, where the camera's front is, to the right; 80
// degrees wide and 100 high, neighbours overlap by a quarter. What lies beyond, the sky above and whoever
// holds the camera below, is left out.
class PanoramaViews {
 public:
  static constexpr int kCount = 6;

  // Of panoramas of this size. Views have the panorama's scale in their middle, unless their longer side
  // would exceed max_side.
  PanoramaViews(int panorama_width, int panorama_height, int max_side);

  int width() const { return width_; }
  int height() const { return height_; }
  double focal_px() const { return focal_px_; }

  // View `i` of a panorama or of its mask.
  io::Image Of(const io::Image& panorama, int i) const;
  io::Mask Of(const io::Mask& mask, int i) const;

 private:
  int width_, height_;
  double focal_px_;
  int panorama_width_, half_columns_;  // of the panorama, on both sides of a view's middle
  io::PixelSources sources_;           // of a view, in its columns of the panorama
};

// Replaces panoramas among the kept pictures, and their masks, by their views, ordered so that those of one
// direction follow one another as the camera did. Says so in report->decisions.
void UnrollPanoramas(const std::filesystem::path& folder, const IngestOptions& options, IngestReport* report);

}  // namespace pipeline
