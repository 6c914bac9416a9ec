// Ends of a walk that hardly anything but the first or the last picture shows.
#pragma once

#include <vector>

#include "nerf/paths/camera_path.h"
#include "nerf/rendering/support_map.h"

namespace nerf {

struct CutEnds {
  double first = 0, last = 0;  // shares of the path that were cut off
};

// Cuts the ends of a walk where more of the picture than usual along the path is seen by one training view at
// most, up to where that is no longer so; what one view shows has no place in depth. An end that does not get
// better within an eighth of the path stays, as do other kinds of path. fitted: has the path's length, and is
// cut alike.
CutEnds CutWeakEnds(const TrainedField& field,
                    const io::Scene& train,
                    const SupportMap& support,
                    int threads,
                    std::vector<io::Rigid3d>* fitted,
                    CameraPath* path);

}  // namespace nerf
