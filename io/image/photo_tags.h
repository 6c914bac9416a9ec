// What a picture file says about its camera: EXIF and colour profile. The tags are claims, not facts: readers
// check ranges before use.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace io {

struct PhotoTags {
  int orientation = 1;           // EXIF 1..8
  std::string make, model;       // empty when absent
  double focal_35mm = 0;         // 35 mm equivalent [mm]; 0: absent
  double focal_mm = 0;           // 0: absent
  double pixels_per_mm = 0;      // on the sensor, for a picture `pixel_x_dimension` wide; 0: absent
  double pixel_x_dimension = 0;  // width the camera wrote [px]; 0: absent
  std::string icc;               // the embedded colour profile; empty: none
};

// Never throws: damaged metadata counts as absent. `file` is a whole JPEG, PNG, TIFF or WebP file.
PhotoTags ReadPhotoTags(std::string_view file);

// `exif` is a TIFF-structured EXIF block; HEIF carries it outside of any container known to ReadPhotoTags.
PhotoTags ParseExif(std::string_view exif);

// Focal length in pixels of a picture of width x height pixels:
//   f = focal_35mm * hypot(width, height) / hypot(36, 24)   (CIPA DCG-001: equal diagonal angle of view), or
//   f = focal_mm * pixels_per_mm * max(width, height) / pixel_x_dimension.
// Nothing when the tags are absent; not checked for plausibility.
std::optional<double> FocalPixels(const PhotoTags& tags, int width, int height);

}  // namespace io
