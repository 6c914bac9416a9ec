#include "sfm/bundle/observation_split.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "sfm/bundle/reprojection_cost.h"

namespace sfm {
namespace {

constexpr std::size_t kPoints = 1500;
// A picture is divided into kGrid x kGrid cells, each of which asks for this many observations.
constexpr int kGrid = 4;
constexpr int kPerCell = 4;
// Eliminating a point costs the square of its observations.
constexpr std::size_t kMaxTrack = 24;
constexpr std::uint64_t kHeldOutOneIn = 10;
constexpr std::size_t kMinTraining = 3;  // fewer leave the point nothing that contradicts a wrong camera

using Track = std::vector<io::Observation>;

// SplitMix64 (Steele et al., OOPSLA 2014).
std::uint64_t Hash(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

int Cell(double x, int size) { return std::clamp(static_cast<int>(kGrid * x / size), 0, kGrid - 1); }

// Evenly spread over the pictures that see the point.
void Thin(Track* track) {
  const std::size_t n = track->size();
  if (n <= kMaxTrack) return;
  for (std::size_t i = 0; i < kMaxTrack; ++i) (*track)[i] = (*track)[i * n / kMaxTrack];
  track->resize(kMaxTrack);
}

// Index of the cell of a frame that shows the observation.
std::size_t Slot(const io::Scene& scene, const io::Observation& observation) {
  const auto frame = static_cast<std::size_t>(observation.frame_index);
  const io::Camera& camera = scene.cameras[static_cast<std::size_t>(scene.frames[frame].camera_index)];
  const int cell = Cell(observation.xy.y(), camera.height) * kGrid + Cell(observation.xy.x(), camera.width);
  return frame * kGrid * kGrid + static_cast<std::size_t>(cell);
}

// Points that fill a cell, then more of the longest, in the order of the model.
std::vector<std::size_t> ChoosePoints(const io::Scene& scene, const std::vector<Track>& tracks) {
  std::vector<std::size_t> order(tracks.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return tracks[a].size() > tracks[b].size();
  });
  std::vector<int> filled(scene.frames.size() * kGrid * kGrid);
  std::vector<std::size_t> chosen, others;
  for (const std::size_t i : order) {
    const bool wanted = std::any_of(tracks[i].begin(), tracks[i].end(), [&](const io::Observation& o) {
      return filled[Slot(scene, o)] < kPerCell;
    });
    (wanted ? chosen : others).push_back(i);
    for (const io::Observation& o : tracks[i]) filled[Slot(scene, o)] += wanted;
  }
  const std::size_t more = std::min(others.size(), kPoints - std::min(kPoints, chosen.size()));
  chosen.insert(chosen.end(), others.begin(), others.begin() + static_cast<std::ptrdiff_t>(more));
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

}  // namespace

ObservationSplit SplitObservations(const io::ColmapModel& model, std::uint64_t seed) {
  std::vector<Track> tracks(model.scene.points.size());
  for (const io::Observation& o : model.observations) {
    tracks[static_cast<std::size_t>(o.point_index)].push_back(o);
  }
  for (Track& track : tracks) Thin(&track);
  ObservationSplit split;
  split.training.scene.cameras = model.scene.cameras;
  split.training.scene.frames = model.scene.frames;
  for (const std::size_t i : ChoosePoints(model.scene, tracks)) {
    std::size_t remaining = tracks[i].size();
    for (io::Observation o : tracks[i]) {
      const std::uint64_t key =
          static_cast<std::uint64_t>(i) << 32 | static_cast<std::uint32_t>(o.frame_index);
      const bool held_out = remaining > kMinTraining && Hash(Hash(seed) ^ key) % kHeldOutOneIn == 0;
      remaining -= held_out;
      o.point_index = static_cast<int>(split.training.scene.points.size());
      (held_out ? split.held_out : split.training.observations).push_back(o);
    }
    split.training.scene.points.push_back(model.scene.points[i]);
  }
  return split;
}

double HeldOutPx(const io::Scene& scene, const std::vector<io::Observation>& held_out) {
  double sum = 0;
  std::size_t n = 0;
  for (const io::Observation& o : held_out) {
    const auto projected = io::Project(scene, o);
    if (!projected) continue;
    sum += RobustLoss((*projected - o.xy).squaredNorm() / (o.sigma * o.sigma));
    ++n;
  }
  return n == 0 ? 0 : std::sqrt(sum / static_cast<double>(n));
}

}  // namespace sfm
