// The depth of a rendered view as a picture.
#pragma once

#include "io/image/image.h"
#include "nerf/rendering/rendered_view.h"

namespace pipeline {

// Depth in turbo colours between near and far, faded to black where rays leave the scene.
io::Image DepthPicture(const nerf::RenderedView& view, double near, double far);

}  // namespace pipeline
