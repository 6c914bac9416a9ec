#include "pipeline/film/film_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "io/base/median.h"
#include "nerf/paths/even_path.h"

namespace pipeline {
namespace {

// Sides of a thumbnail: what covers a twentieth of the picture counts, fine texture in motion does not.
constexpr int kThumbnailWidth = 32, kThumbnailHeight = 24;
// A lone frame differs from both neighbours more than so many usual steps; that these are alike tells it from
// motion, so that less than a jump is needed.
constexpr double kLoneSteps = 2;
// Grey levels that may come and go between frames in a still film.
constexpr double kLeastDifference = 1;
// Frame numbers that one line names.
constexpr std::size_t kMostNamed = 10;

// Mean difference of two thumbnails in grey levels.
double Difference(const std::string& a, const std::string& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += std::abs(static_cast<unsigned char>(a[i]) - static_cast<unsigned char>(b[i]));
  return sum / static_cast<double>(std::max<std::size_t>(1, a.size()));
}

std::string Numbers(const std::vector<int>& frames) {
  std::string list;
  for (std::size_t i = 0; i < std::min(kMostNamed, frames.size()); ++i)
    list += fmt::format("{}{}", i == 0 ? "" : ", ", frames[i] + 1);
  if (frames.size() > kMostNamed) list += fmt::format(" and {} more", frames.size() - kMostNamed);
  return list;
}

}  // namespace

std::string Thumbnail(const io::Image& frame) {
  const io::Image small = io::ResizeArea(frame, kThumbnailWidth, kThumbnailHeight);
  return {small.data.begin(), small.data.end()};
}

FilmFaults FaultsOf(const std::vector<std::string>& thumbnails) {
  FilmFaults faults;
  const int n = static_cast<int>(thumbnails.size());
  if (n < 3) return faults;
  std::vector<double> steps;  // [i]: from frame i to i + 1
  for (std::size_t i = 1; i < thumbnails.size(); ++i)
    steps.push_back(std::max(kLeastDifference, Difference(thumbnails[i - 1], thumbnails[i])));
  for (int i = 1; i + 1 < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double least = std::min(steps[at - 1], steps[at]);
    if (least > kLoneSteps * nerf::UsualStep(steps, i) &&
        Difference(thumbnails[at - 1], thumbnails[at + 1]) < least)
      faults.lone.push_back(i);
  }
  for (const int step : nerf::JumpsAmong(steps)) {
    const bool beside_lone = std::any_of(faults.lone.begin(), faults.lone.end(), [&](int frame) {
      return frame == step || frame == step + 1;
    });
    if (!beside_lone) faults.jumps.push_back(step + 1);
  }
  return faults;
}

std::vector<std::string> CheckPath(const nerf::CameraPath& path) {
  const std::vector<double> steps = nerf::StepsOf(path);
  const auto largest = std::max_element(steps.begin(), steps.end());
  const double typical = io::Median(steps);
  if (!(typical > 0)) return {};
  std::vector<std::string> lines = {
      fmt::format("even path: the largest step between frames shows {:.1f} times the median motion, after "
                  "frame {}",
                  *largest / typical,
                  largest - steps.begin() + 1)};
  std::vector<int> jumps = nerf::JumpsAmong(steps);
  for (int& frame : jumps) frame = (frame + 1) % static_cast<int>(path.world_from_cam.size());
  if (!jumps.empty()) lines.push_back("warning: the camera path jumps to frame " + Numbers(jumps));
  return lines;
}

std::vector<std::string> CheckFrames(const std::vector<std::string>& thumbnails) {
  const FilmFaults faults = FaultsOf(thumbnails);
  std::vector<std::string> lines;
  if (!faults.jumps.empty()) lines.push_back("warning: the picture jumps to frame " + Numbers(faults.jumps));
  if (!faults.lone.empty())
    lines.push_back("warning: unlike the frames before and after it: frame " + Numbers(faults.lone));
  return lines;
}

}  // namespace pipeline
