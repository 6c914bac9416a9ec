// The masks that a user made for the photos of a capture: one folder of pictures named as the photos.
#pragma once

#include <filesystem>
#include <vector>

#include "io/image/mask.h"
#include "io/image/photo.h"

namespace pipeline {

// The mask of each photo, in order; empty where there is none. IMG_1.jpg has the mask IMG_1.png or, as COLMAP
// names it, IMG_1.jpg.png; any extension of a picture that can be read will do. Throws kUsage when `folder`
// is no folder or holds the photos themselves, kBadInput when a picture in it is damaged, two share a stem,
// or none belongs to a photo.
std::vector<std::filesystem::path> MatchMasks(const std::filesystem::path& folder,
                                              const std::vector<std::filesystem::path>& photos);

// The mask at the size of photo.image. Masks are drawn over the photo as a viewer shows it, upright; one that
// has the size of the stored pixels is turned as they are. Throws kBadInput when it cannot be read or has
// neither size.
io::Mask ReadPhotoMask(const std::filesystem::path& path, const io::Photo& photo);

}  // namespace pipeline
