// What moves before a camera that stands still: the subject on a turntable, cut out of its background.
#pragma once

#include <vector>

#include "io/image/image.h"
#include "io/image/mask.h"
#include "io/scene/scene.h"

namespace sfm {

// At the size at which pictures are compared, 512 pixels or less.
struct MovingSubject {
  io::Mask shown;    // 255: the subject, 0: the background
  io::Mask certain;  // 0: where either may be, around the subject's edge and where colours do not tell

  // Of the picture, what certainly shows the subject.
  double Share() const;
};

// The subject in each picture of a turntable, whose poses are those of a camera around it. The background is
// the colour that a pixel has most often; what differs from it is the subject. Where the subject looks the
// same all the way round, it would pass for background itself. So what lies among points is the
// subject as well, since all points lie on it (those of its far side, too: the subject itself hides them),
// and what it encloses where that hardly ever changes. A colour that a pixel has mostly where points lie is
// none of the background's. Other gaps in it, and what has the background's colour near a point, may be
// either.
//
// Empty when the pictures differ in size or when there is no background: hardly a pixel keeps its colour, or
// nothing moves before it. Throws kBadInput for a picture that cannot be read.
std::vector<MovingSubject> SubjectsOnTurntable(const io::Scene& scene, int threads);

struct CutPicture {
  io::Image image;   // transparent where the background is shown
  io::Mask certain;  // of its size; not what its mask leaves out
};

// The picture, of any size, without its background. used: its mask.
CutPicture CutOut(const io::Image& picture, const io::Mask& used, const MovingSubject& subject);

}  // namespace sfm
