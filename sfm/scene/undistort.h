// Pictures taken through a distorting lens, resampled as a pinhole camera would have taken them.
#pragma once

#include <filesystem>

#include "io/process/shared_work.h"
#include "io/scene/scene.h"

namespace sfm {

// Whether every pixel at the border of the picture has a viewing ray: a distortion that folds back inside the
// picture leaves some without.
bool HasRaysAtBorder(const io::Camera& camera);

// The pinhole camera of the same size whose picture is covered entirely by `camera`'s: principal point at the
// centre, fl_x / fl_y kept, and the widest field of view that leaves no empty border. A camera without
// distortion is returned unchanged. Throws io::Error kBadInput when the distortion folds back inside the
// picture.
io::Camera PinholeCamera(const io::Camera& camera);

// Writes the picture of every frame into folder/images and its mask, if it has one, into folder/masks;
// returns the scene with pinhole cameras and these (absolute) paths. Pictures without distortion are copied
// byte for byte; the others become PNG, resampled with an 8x8 Lanczos kernel. A mask says of each pixel what
// it said of the one that the pixel's centre comes from; what comes from outside is not used. Names keep
// their stem; a repeated one gets _2. Poses and points are unchanged. Throws kBadInput naming the picture or
// mask that cannot be read or does not have its camera's size. By all ranks (io/process/shared_work.h), where
// pictures lie in the same places beside `folder`.
io::Scene UndistortScene(const io::Scene& scene, const std::filesystem::path& folder, int threads);

// What the other ranks do for it.
void AddUndistortionWork(const std::filesystem::path& folder, int threads, io::ToldWorks* works);

}  // namespace sfm
