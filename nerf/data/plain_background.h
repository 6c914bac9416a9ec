// Objects before one colour, such as the white that renderers and light tents have.
#pragma once

#include "io/base/memory.h"
#include "nerf/data/dataset.h"

namespace nerf {

// The background of opaque pictures: the colour that at least 98 % of the used pixels on their borders have,
// to within 2 of 255 levels (JPEG), where at least half of the pixels there are used. If there is one, sets
// dataset->background and appends an alpha channel:
//     0  the pixel has that colour, and a path of such pixels joins it to the border of the picture: nothing
//        but background can be there
//   255  no pixel beside it has that colour: it is taken for opaque (what is translucent becomes opaque)
//   128  any other, whose colour may have background in it
// Pixels that are not used never get 0.
// Pictures with alpha stay as they are.
// Throws kNoResources when the memory does not suffice for the channel.
void MarkPlainBackground(Dataset* dataset, const io::MemoryBudget& memory = io::MemoryBudget());

}  // namespace nerf
