// Numbers as grey PNG files of 8 or 16 bits: depth, counts. Pictures in colour are in io/image/image.h.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

namespace io {

// values[height][width], lossless, atomically. Throws kNoResources.
void WriteGreyPng(const std::filesystem::path& path,
                  int width,
                  int height,
                  std::span<const std::uint8_t> values);
void WriteGreyPng(const std::filesystem::path& path,
                  int width,
                  int height,
                  std::span<const std::uint16_t> values);

}  // namespace io
