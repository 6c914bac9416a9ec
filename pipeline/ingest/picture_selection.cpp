#include "pipeline/ingest/picture_selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "io/base/check.h"
#include "io/base/median.h"

namespace pipeline {
namespace {

constexpr std::size_t kNeighbours = 15;  // a median over it survives a run of seven blurred pictures
constexpr std::size_t kMinSet = 5;       // below, there is no typical sharpness

// sharpness[i] relative to the median of the window around it; at both ends the window is shifted, not cut.
std::vector<double> RelativeSharpness(std::span<const double> sharpness) {
  const std::size_t n = sharpness.size(), window = std::min(n, kNeighbours);
  std::vector<double> relative(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t begin = std::min(i - std::min(i, window / 2), n - window);
    const auto part = sharpness.subspan(begin, window);
    const double median = io::Median(std::vector<double>(part.begin(), part.end()));
    relative[i] = median > 0 ? sharpness[i] / median : 1;
  }
  return relative;
}

std::string BlurReason(double relative) {
  return fmt::format("blurred: {:.2f} times as sharp as its neighbours", relative);
}

bool ShowTheSame(const io::Thumbnail& a, const io::Thumbnail& b, const SelectionOptions& options) {
  return io::Difference(a, b) < options.min_difference &&
         io::LargestDifference(a, b) <= options.max_local_difference;
}

}  // namespace

std::vector<bool> FindBlurred(std::span<const double> sharpness, const SelectionOptions& options) {
  std::vector<bool> blurred(sharpness.size(), false);
  if (sharpness.size() < kMinSet) return blurred;
  const std::vector<double> relative = RelativeSharpness(sharpness);
  std::vector<std::size_t> worst_first(sharpness.size());
  std::iota(worst_first.begin(), worst_first.end(), 0);
  std::stable_sort(worst_first.begin(), worst_first.end(), [&](std::size_t a, std::size_t b) {
    return relative[a] < relative[b];
  });
  worst_first.resize(
      static_cast<std::size_t>(options.max_blurred_share * static_cast<double>(sharpness.size())));
  for (const std::size_t i : worst_first) blurred[i] = relative[i] < options.min_relative_sharpness;
  return blurred;
}

std::vector<std::string> JudgePhotos(std::span<const PictureLook> looks,
                                     std::span<const std::string> names,
                                     const SelectionOptions& options) {
  PIPELINE_CHECK_EQ(looks.size(), names.size());
  std::vector<std::string> reasons(looks.size());
  for (std::size_t i = 1, last = 0; i < looks.size(); ++i) {
    if (ShowTheSame(looks[last].thumbnail, looks[i].thumbnail, options)) {
      const std::size_t worse = looks[i].sharpness > looks[last].sharpness ? last : i;
      reasons[worse] = "shows the same as " + names[worse == i ? last : i];
      if (worse == i) continue;
    }
    last = i;
  }
  std::vector<std::size_t> left;
  std::vector<double> sharpness;
  for (std::size_t i = 0; i < looks.size(); ++i) {
    if (reasons[i].empty()) {
      left.push_back(i);
      sharpness.push_back(looks[i].sharpness);
    }
  }
  const std::vector<bool> blurred = FindBlurred(sharpness, options);
  const std::vector<double> relative = RelativeSharpness(sharpness);
  for (std::size_t k = 0; k < left.size(); ++k) {
    if (blurred[k]) reasons[left[k]] = BlurReason(relative[k]);
  }
  return reasons;
}

std::vector<FrameVerdict> JudgeFrames(std::span<const double> path,
                                      std::span<const double> sharpness,
                                      int first_index,
                                      const SelectionOptions& options) {
  PIPELINE_CHECK_EQ(path.size(), sharpness.size());
  std::vector<FrameVerdict> verdicts(path.size());
  if (path.empty()) return verdicts;
  const double total = path.back();
  const int n_steps =
      std::clamp(static_cast<int>(std::ceil(total / options.frame_step)), 1, options.max_frames);
  const auto step_of = [&](std::size_t i) {
    return total > 0 ? std::min(n_steps - 1, static_cast<int>(path[i] / total * n_steps)) : 0;
  };
  std::vector<std::size_t> chosen;
  for (std::size_t begin = 0, end = 0; begin < path.size(); begin = end) {
    std::size_t best = begin;
    for (end = begin; end < path.size() && step_of(end) == step_of(begin); ++end) {
      if (sharpness[end] > sharpness[best]) best = end;
    }
    for (std::size_t i = begin; i < end; ++i) {
      verdicts[i].reason =
          fmt::format("frame {} shows nearly the same and is sharper", first_index + static_cast<int>(best));
    }
    chosen.push_back(best);
  }
  std::vector<double> chosen_sharpness;
  for (const std::size_t i : chosen) chosen_sharpness.push_back(sharpness[i]);
  const std::vector<bool> blurred = FindBlurred(chosen_sharpness, options);
  const std::vector<double> relative = RelativeSharpness(chosen_sharpness);
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    verdicts[chosen[k]] = {!blurred[k], blurred[k] ? BlurReason(relative[k]) : ""};
  }
  return verdicts;
}

}  // namespace pipeline
