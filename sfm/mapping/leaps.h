// Where a walk seems to have leapt: the mark of a place that was taken for another one like it.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "io/scene/scene.h"

namespace sfm {

// Pictures that lie beyond a leap, given all names in the order of the capture. A leap is a step between
// pictures at most 3 apart in that order that turns by 60 degrees or moves by 6 times as much as 9 in 10 of
// the steps do, or more; rotations must be 3 times theirs, too, so that pictures in no order have none. Leaps
// cut the capture into parts. A part goes when fewer than a tenth of the points that it sees are seen by any
// picture outside of it: two desks of a kind share that many, a place that was visited twice shares more. The
// largest part stays.
std::set<std::string> PicturesBeyondLeaps(const io::Scene& scene, const std::vector<std::string>& names);

}  // namespace sfm
