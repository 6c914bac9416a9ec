// Tells lack of room from faults of a program that ran into it: few say so.
#pragma once

#include <filesystem>

namespace io {

// Throws kNoResources with the figure when the file system of `folder` is full, or a file below it is as
// large as files may be (ulimit -f). Call it where something that writes there has failed, before its
// products are removed.
void ThrowIfFull(const std::filesystem::path& folder);

}  // namespace io
