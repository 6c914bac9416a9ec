// Local features of a picture: where they are and what they look like.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/base/memory.h"

namespace sfm {

// Pixels of the full-size picture; the centre of the top-left pixel is (0.5, 0.5).
struct Keypoint {
  float x = 0, y = 0;
  float scale = 1;  // radius of the blurred spot
  float angle = 0;  // radians, from +x towards +y
};

constexpr int kDescriptorBytes = 128;

struct Features {
  std::vector<Keypoint> keypoints;
  std::vector<std::uint8_t> descriptors;  // one row of kDescriptorBytes per keypoint
};

struct FeatureOptions {
  int max_features = 2048;    // per picture, those of highest contrast
  int max_image_size = 1600;  // longer side in pixels for detection; 0: full size
  // Half of OpenCV's default and COLMAP's value: soft textures still give features; the strongest are kept.
  double min_contrast = 0.02;
  // Contrast is evened out first, so that plain walls beside dark things give features that look alike in
  // other pictures, too; they are not those of the picture as it is.
  bool even_contrast = false;
  int threads = 1;
  io::MemoryBudget memory = io::MemoryBudget();  // fewer threads detect where it is short
};

// SIFT features (Lowe, IJCV 2004; OpenCV's implementation, first octave at twice the detection size) with
// RootSIFT descriptors (Arandjelovic and Zisserman, CVPR 2012): sqrt(d / |d|_1) * 512, as bytes. One entry
// per name; a picture without texture has none. masks_folder: empty, or holds masks (io/image/mask.h), a.png
// for a.jpg; only keypoints on used pixels are kept, and a picture without a mask is used whole. The result
// does not depend on `threads`. Throws io::Error kBadInput naming the picture or mask that cannot be read, or
// whose sizes differ, kNoResources when the memory does not suffice.
std::vector<Features> DetectFeatures(const std::filesystem::path& images_folder,
                                     const std::vector<std::string>& names,
                                     const std::filesystem::path& masks_folder,
                                     const FeatureOptions& options);

// Bytes that detection in one picture takes: in float, the doubled picture and its smaller octaves, each as 6
// blurred pictures and the 5 differences between them, 4 * 4 * 11 * 4/3 = 235 bytes per pixel.
std::size_t DetectionBytes(int width, int height, const FeatureOptions& options);

// The `max_count` features of largest scale, largest first.
Features LargestFeatures(const Features& features, int max_count);

}  // namespace sfm
