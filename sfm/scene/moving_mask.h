// What moves before a camera that stands still: the subject on a turntable, without its background.
#pragma once

#include <vector>

#include "io/image/mask.h"
#include "io/scene/scene.h"

namespace sfm {

// The subject in each picture of a turntable, whose poses are those of a camera around it. The background is
// the colour that a pixel has most often; what differs from it is the subject. Where the subject looks the
// same all the way round, it would pass for background itself: so everything near a point that the picture
// observes is the subject as well, since all points lie on it, and so is what it encloses.
//
// Empty when the pictures differ in size or when there is no background: hardly a pixel keeps its colour, or
// nothing moves before it. Throws kBadInput for a picture that cannot be read.
std::vector<io::Mask> MasksOfMoving(const io::Scene& scene, int threads);

}  // namespace sfm
