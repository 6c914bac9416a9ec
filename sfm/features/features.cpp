#include "sfm/features/features.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/base/error.h"
#include "io/image/image_size.h"
#include "io/image/mask.h"
#include "io/process/parallel.h"
#include "io/process/progress.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

constexpr double kEdgeThreshold = 10, kSigma = 1.6;
constexpr int kOctaveLayers = 3;
// OpenCV doubles the picture with pixel centres mapped to pixel centres, x2 = 2 x + 1/2, and halves the
// keypoints' positions as if x2 = 2 x: they come out 1/4 pixel too large (opencv/opencv#23123). Positions
// count from the centre of the first pixel, which is at 1/2 here.
constexpr float kPositionOffset = 0.5f - 0.25f;
constexpr float kDescriptorScale = 512;
// Contrast-limited adaptive histogram equalisation (Zuiderveld, Graphics Gems IV, 1994): enough that cables
// on a desk stand out as far as a window frame does, little enough that noise on a wall gives few features.
constexpr double kContrastLimit = 3;
constexpr int kContrastTiles = 8;  // in each direction

cv::Mat ReadGrey(const fs::path& path) {
  cv::Mat picture = cv::imread(path.string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  if (picture.empty()) {
    throw io::Error(io::ExitCode::kBadInput,
                    path.string() + ": cannot be read as a picture",
                    "Run pipeline ingest again");
  }
  return picture;
}

void WriteRootSift(const float* sift, std::uint8_t* descriptor) {
  float sum = 0;
  for (int k = 0; k < kDescriptorBytes; ++k) sum += sift[k];
  for (int k = 0; k < kDescriptorBytes; ++k) {
    const float root = sum > 0 ? kDescriptorScale * std::sqrt(sift[k] / sum) : 0.0f;
    descriptor[k] = static_cast<std::uint8_t>(std::min(255.0f, std::round(root)));
  }
}

// The mask at detection size; empty without a mask.
cv::Mat DetectionMask(const fs::path& folder, const std::string& name, cv::Size picture_size, cv::Size size) {
  const fs::path path = folder / fs::path(name).replace_extension(".png");
  if (folder.empty() || !fs::exists(path)) return {};
  const io::Mask mask =
      io::ShrinkMask(io::ReadMask(path, picture_size.width, picture_size.height), size.width, size.height);
  return cv::Mat(mask.used, true).reshape(0, mask.height);
}

Features Detect(const fs::path& path, const fs::path& masks_folder, const FeatureOptions& options) {
  cv::Mat picture = ReadGrey(path);
  const cv::Size full = picture.size();
  const int longer = std::max(full.width, full.height);
  if (options.max_image_size > 0 && longer > options.max_image_size) {
    const double scale = static_cast<double>(options.max_image_size) / longer;
    const cv::Size size(static_cast<int>(std::lround(full.width * scale)),
                        static_cast<int>(std::lround(full.height * scale)));
    cv::resize(picture, picture, size, 0, 0, cv::INTER_AREA);
  }
  if (options.even_contrast)
    cv::createCLAHE(kContrastLimit, {kContrastTiles, kContrastTiles})->apply(picture, picture);
  const float scale_x = static_cast<float>(full.width) / static_cast<float>(picture.cols);
  const float scale_y = static_cast<float>(full.height) / static_cast<float>(picture.rows);
  const cv::Ptr<cv::SIFT> sift =
      cv::SIFT::create(options.max_features, kOctaveLayers, options.min_contrast, kEdgeThreshold, kSigma);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  sift->detectAndCompute(picture,
                         DetectionMask(masks_folder, path.filename().string(), full, picture.size()),
                         keypoints,
                         descriptors);

  // Ties at the cut let OpenCV keep more than asked for, in an order of its own.
  std::vector<std::size_t> order(keypoints.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return keypoints[a].response > keypoints[b].response;
  });
  order.resize(std::min<std::size_t>(order.size(), static_cast<std::size_t>(options.max_features)));
  Features features;
  features.descriptors.resize(order.size() * kDescriptorBytes);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const cv::KeyPoint& k = keypoints[order[i]];
    features.keypoints.push_back({.x = (k.pt.x + kPositionOffset) * scale_x,
                                  .y = (k.pt.y + kPositionOffset) * scale_y,
                                  .scale = k.size / 2 * scale_x,
                                  .angle = k.angle * static_cast<float>(std::numbers::pi / 180)});
    WriteRootSift(descriptors.ptr<float>(static_cast<int>(order[i])),
                  &features.descriptors[i * kDescriptorBytes]);
  }
  return features;
}

// Threads that detect at once within the memory, beside the features and half as much again for matching.
int DetectionThreads(const fs::path& images_folder,
                     const std::vector<std::string>& names,
                     const FeatureOptions& options) {
  if (names.empty()) return 1;
  std::size_t largest = 0;
  for (const std::string& name : names) {
    const io::ImageSize size = io::ReadImageSize(images_folder / name);
    largest = std::max(largest, DetectionBytes(size.width, size.height, options));
  }
  const std::size_t kept =
      names.size() * static_cast<std::size_t>(options.max_features) * (kDescriptorBytes + sizeof(Keypoint));
  return options.memory.AtOnce(options.threads,
                               largest,
                               kept + kept / 2,
                               fmt::format("detecting features in {} pictures", names.size()));
}

}  // namespace

std::size_t DetectionBytes(int width, int height, const FeatureOptions& options) {
  constexpr double kBytesPerPixel = 235;
  const double pixels = 1.0 * width * height, longer = std::max(width, height);
  const double scale = options.max_image_size > 0 ? std::min(1.0, options.max_image_size / longer) : 1.0;
  // As it was read, in colour before it is grey.
  return static_cast<std::size_t>(pixels * (scale < 1 ? 4 : 3) + pixels * scale * scale * kBytesPerPixel);
}

std::vector<Features> DetectFeatures(const fs::path& images_folder,
                                     const std::vector<std::string>& names,
                                     const fs::path& masks_folder,
                                     const FeatureOptions& options) {
  cv::setNumThreads(1);  // whole pictures are spread over the threads instead
  std::vector<Features> features(names.size());
  io::Progress progress("features");
  std::size_t done = 0;
  std::mutex mutex;
  io::ParallelFor(names.size(), DetectionThreads(images_folder, names, options), [&](std::size_t i) {
    features[i] = Detect(images_folder / names[i], masks_folder, options);
    const std::lock_guard lock(mutex);
    ++done;
    progress.Update(static_cast<double>(done) / static_cast<double>(names.size()),
                    fmt::format("{} of {}", done, names.size()));
  });
  return features;
}

Features LargestFeatures(const Features& features, int max_count) {
  std::vector<std::size_t> order(features.keypoints.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return features.keypoints[a].scale > features.keypoints[b].scale;
  });
  order.resize(std::min<std::size_t>(order.size(), static_cast<std::size_t>(max_count)));
  Features largest;
  for (const std::size_t i : order) {
    largest.keypoints.push_back(features.keypoints[i]);
    const auto row = features.descriptors.begin() + static_cast<std::ptrdiff_t>(i * kDescriptorBytes);
    largest.descriptors.insert(largest.descriptors.end(), row, row + kDescriptorBytes);
  }
  return largest;
}

}  // namespace sfm
