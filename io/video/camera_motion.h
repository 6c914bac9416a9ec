// How far the picture has moved along a video: a path length that grows with real motion only.
#pragma once

#include <memory>

#include "io/image/image.h"

namespace io {

// Corners of an anchor frame are followed into each new frame (pyramidal Lucas-Kanade, 320 px wide). The
// displacement is the median length of their motion in picture widths, so that parallax, turning and zooming
// all count, or half the length that a fifth of them exceed: a subject on a turntable moves before a
// background that stands still. The anchor moves on only after 1 % of the width: noise and tremor add
// nothing.
class CameraMotion {
 public:
  CameraMotion();
  ~CameraMotion();

  // Frames in order, all of one size. Returns the path from the first frame to this one, in picture widths;
  // never decreases. A cut or a jump that cannot be followed counts 0.05.
  double Advance(const Image& frame);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace io
