#include "sfm/bundle/observation_sigma.h"
#include "io/base/median.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace sfm {
namespace {

constexpr double kExponent = 0.7;
// Features smaller than a pixel are not placed better still: the noise of the pixels remains.
constexpr double kMinScalePx = 1.0;

using Scales = std::map<std::pair<float, float>, float>;

// Several keypoints of one place differ in their orientation only.
Scales ScalesByPosition(const Features& features) {
  Scales scales;
  for (const Keypoint& keypoint : features.keypoints) scales[{keypoint.x, keypoint.y}] = keypoint.scale;
  return scales;
}

}  // namespace

void SetSigmas(const std::vector<std::string>& names,
               const std::vector<Features>& features,
               io::ColmapModel* model) {
  std::map<std::string, const Features*> by_name;
  for (std::size_t i = 0; i < names.size(); ++i) by_name[names[i]] = &features[i];
  std::vector<Scales> scales;
  for (const io::Frame& frame : model->scene.frames) {
    scales.push_back(ScalesByPosition(*by_name.at(frame.image_path.string())));
  }
  std::vector<std::pair<io::Observation*, double>> found;
  for (io::Observation& observation : model->observations) {
    const Scales& of_frame = scales[static_cast<std::size_t>(observation.frame_index)];
    const auto at =
        of_frame.find({static_cast<float>(observation.xy.x()), static_cast<float>(observation.xy.y())});
    if (at == of_frame.end()) continue;
    found.emplace_back(&observation, std::pow(std::max<double>(at->second, kMinScalePx), kExponent));
  }
  if (found.empty()) return;
  std::vector<double> sigmas;
  for (const auto& [observation, sigma] : found) sigmas.push_back(sigma);
  const double median = io::Median(std::move(sigmas));
  for (const auto& [observation, sigma] : found) observation->sigma = sigma / median;
}

}  // namespace sfm
