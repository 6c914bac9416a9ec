// Which pictures of a set are worth keeping. Pure functions of measured numbers.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "io/image/picture_measure.h"

namespace pipeline {

struct SelectionOptions {
  // A picture is blurred when its sharpness is below this share of the median of its 15 nearest neighbours; 0
  // keeps all. Measured: hand-held captures stay above 0.4, motion of 1 % of the width gives 0.1 to 0.2.
  double min_relative_sharpness = 0.3;
  double max_blurred_share = 0.3;  // of the set; when more look blurred, only the worst go
  // Mean grey difference [0..255] of 32 x 32 thumbnails of neighbours that show the same. Measured: walking
  // captures stay above 6, a tremor of 0.2 % of the width gives 0.8 to 1.7.
  double min_difference = 1.5;
  // What neighbours that show the same differ by at most, anywhere in their thumbnails. A subject that turns
  // before a still background changes little of the picture, but that much: by 7 degrees 17 to 50, where the
  // mean is 0.7 to 1.1. A tremor of 0.2 % of the width reaches 16.
  int max_local_difference = 16;
  int max_frames = 120;  // of a video
  // Path between kept frames of a video, in picture widths (io/video/camera_motion.h). A walk around a table
  // makes 3 to 6 widths, a third of a turn near a subject 0.6, a whole turn of a turntable before a still
  // background 0.3: frames are then 6 degrees apart.
  double frame_step = 0.005;
};

struct PictureLook {
  double sharpness = 0;
  io::Thumbnail thumbnail = {};
};

// For each sharpness, in sequence: true when it is a clear outlier below its neighbours.
std::vector<bool> FindBlurred(std::span<const double> sharpness, const SelectionOptions& options);

// For each photo, in sequence: why it is dropped; empty when it is kept. Of two neighbours that show the
// same, the sharper one stays. names: for the reasons.
std::vector<std::string> JudgePhotos(std::span<const PictureLook> looks,
                                     std::span<const std::string> names,
                                     const SelectionOptions& options);

struct FrameVerdict {
  bool kept = false;
  std::string reason;  // when dropped
};

// path: io::CameraMotion's value per frame. The path is cut into equal steps of at least frame_step, at most
// max_frames of them; the sharpest frame of each step is chosen, and blurred ones among the chosen are
// dropped.
std::vector<FrameVerdict> JudgeFrames(std::span<const double> path,
                                      std::span<const double> sharpness,
                                      int first_index,
                                      const SelectionOptions& options);

}  // namespace pipeline
