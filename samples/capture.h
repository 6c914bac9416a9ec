// A complete sample capture on disk: photographs or a film of the still life, and beside them, apart, the
// truth.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "io/scene/scene.h"

namespace samples {

enum class CaptureKind {
  kPhotos,    // hand-held orbit
  kVideo,     // walk-around as a film
  kRotation,  // turning about one's own centre: no baseline
  kBlank,     // the orbit in an empty room without texture
  kForward,   // walking straight ahead
};

// "photos", "video", ... Throws kUsage naming the kinds.
CaptureKind ParseCaptureKind(const std::string& name);

struct CaptureOptions {
  std::filesystem::path out;  // new, empty, or an earlier capture, which is replaced
  CaptureKind kind = CaptureKind::kPhotos;
  int photos = 60;
  int width = 960;         // [px], a multiple of 8; the height is three quarters of it
  std::uint64_t seed = 1;  // of paint, hand and sensor
  int threads = 1;         // does not change the result
  bool depth = false;      // also write the depth of every tenth photograph

  double focal_per_width = 0.85;
  double k1 = -0.06;          // radial distortion (io/scene/scene.h)
  int photo_samples = 4;      // rays per pixel
  double noise_sigma = 1.2;   // sensor noise, in 1/255
  double exposure_ev = 0.15;  // largest change between photographs, +-
  int jpeg_quality = 92;
  int test_views = 12;  // held-out, pinhole, without noise; 0: none

  double video_s = 12, video_fps = 30;
  int video_samples = 2;     // rays per pixel
  int video_blurs = 4;       // how often the camera is knocked; each knock blurs three frames
  double blur_angle = 0.04;  // how far a knocked camera turns while the shutter is open [rad]
};

struct CaptureReport {
  int pictures = 0;  // photographs, or frames of the film
  double wall_s = 0;
};

// The lens of the photographs.
io::Camera CaptureCamera(const CaptureOptions& options);

// Writes, complete or not at all, below `out`:
//   * photos/IMG_0001.jpg ..., or walkaround.mp4
//   * truth/transforms.json: pose and lens of every picture; film frames are named as `pipeline ingest` does
//   * truth/photos/: hard links to the photographs, since transforms.json names only files below itself
//   * truth/depth/IMG_0001.pfm ..., if asked for: distance along each pixel's centre ray, scene units
//   * truth/test/001.png ... and truth/transforms_test.json: the held-out views
//   * truth/blurred_frames.txt: names of a film's blurred frames
// Throws kUsage for options that make no capture, kNoResources, kMissingTool without ffmpeg.
CaptureReport WriteCapture(const CaptureOptions& options);

}  // namespace samples
