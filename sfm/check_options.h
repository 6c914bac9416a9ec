// What a user may ask of a reconstruction.
#pragma once

#include "sfm/reconstruction.h"

namespace sfm {

// Throws io::Error kUsage naming the option that has an unknown value.
void CheckOptions(const ReconstructionOptions& options);

}  // namespace sfm
