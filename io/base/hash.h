// Content hashes (XXH3, 128 bits, hexadecimal) for the stage cache. Not cryptographic: they detect change,
// not malice.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace io {

std::string HashBytes(std::string_view bytes);

// Streams the file. Throws kBadInput when it cannot be read.
std::string HashFile(const std::filesystem::path& path);

}  // namespace io
