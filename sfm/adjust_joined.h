// The first adjustment of a model whose parts were mapped separately.
#pragma once

#include "io/scene/colmap_model.h"

namespace sfm {

// Moves the cameras so that the parts fit together, all by the camera model that they were mapped with. About
// 1500 points, or as many as show in all parts of all pictures, decide; the other points stay where they are.
void AdjustJoined(io::ColmapModel* model);

// The same with all points, for parts that so few of them hold together that a choice might leave those out.
void AdjustBridged(io::ColmapModel* model);

}  // namespace sfm
