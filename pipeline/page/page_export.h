// Writes the page that plays a scene: one HTML file, complete in itself, for any browser with WebGL 2.
#pragma once

#include <filesystem>
#include <string>

#include "io/scene/scene.h"

namespace pipeline {

// Larger pages take phones too long to open, or too much of their memory.
inline constexpr std::size_t kMaxPageBytes = 40 << 20;

// The view starts at the first camera of `train`. A page that would be larger than max_bytes goes without its
// splats. Returns the size of the file in bytes. Throws kBadInput for a field of another kind than `hash` or
// too large a page, kBadState for a damaged checkpoint, kNoResources for a full disk.
std::size_t ExportPage(const io::Scene& train,
                       const std::filesystem::path& checkpoint,
                       const std::string& name,
                       const std::filesystem::path& file,
                       std::size_t max_bytes = kMaxPageBytes);

}  // namespace pipeline
