// Makes pictures of a fisheye lens or an action camera what a pinhole camera shows, so that all stages
// behind, and other programs, have straight lines to work with.
#pragma once

#include <filesystem>

#include "io/image/image.h"
#include "io/image/mask.h"
#include "io/image/resample.h"
#include "pipeline/ingest/ingest.h"

namespace pipeline {

// What a pinhole camera shows of the pictures of a curved lens (sfm/features/lens_curvature.h).
class StraightView {
 public:
  // The largest pinhole picture inside of the lens's, at most 120 degrees wide and high, with the scale of
  // the lens in its middle unless its longer side would exceed max_side.
  StraightView(double curvature, int width, int height, int max_side);

  int width() const { return width_; }
  int height() const { return height_; }
  double focal_px() const { return focal_px_; }  // about: sfm::FisheyeFocal
  double degrees() const;                        // across its width

  io::Image Of(const io::Image& picture) const;
  io::Mask Of(const io::Mask& mask) const;

 private:
  int width_, height_;
  double focal_px_;
  int samples_;  // per pixel's side, of a picture that shrinks
  io::PixelSources for_images_, for_masks_;
};

// Straightens the kept pictures in folder/images and their masks in folder/masks, where matches among a
// sample of them say that the lens is strongly curved; camera by camera. Photos whose metadata name a focal
// length of no wide-angle lens are not looked at. Says so in report->decisions.
void StraightenLenses(const std::filesystem::path& folder,
                      const IngestOptions& options,
                      IngestReport* report);

}  // namespace pipeline
