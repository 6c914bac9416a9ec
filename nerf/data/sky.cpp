#include "nerf/data/sky.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "nerf/data/capture_geometry.h"

namespace nerf {
namespace {

// Colours, in levels of 255.
constexpr int kLeastBlue = 130, kNearlyWhite = 235, kLeastCloud = 150, kMostCloudColour = 64;
// Of a channel, from one pixel to the next: what is farther apart is no part of the same region.
constexpr int kMostStep = 16;
// Of the longer side of a picture: cells that a sparse point falls into, and those beside them, are no sky.
constexpr int kCells = 128;
// Of a region that is a sky: its share of the picture; of its pixels those that are no cloud; those that lie
// below the horizon, as of walls many do, by more than an error of the camera's tilt (sine of the angle); and
// the mean difference of pixels a cell apart, in levels: plaster and brick have more.
constexpr double kLeastShare = 0.02, kLeastClear = 0.5, kMostBelow = 0.02, kBelow = -0.05, kMostContrast = 6;
// Of points that count: their place is known, and they are no clouds.
constexpr std::size_t kSureObservers = 3;
constexpr double kMinParallax = 2 * 3.14159265358979323846 / 180;

enum class Look : std::uint8_t { kOther, kCloud, kClear };

Look LookOf(const std::uint8_t* rgb) {
  const int red = rgb[0], green = rgb[1], blue = rgb[2];
  const auto [low, high] = std::minmax({red, green, blue});
  if (low >= kNearlyWhite) return Look::kClear;
  if (blue >= kLeastBlue && blue >= green && 4 * (blue - red) >= blue) return Look::kClear;
  return low >= kLeastCloud && high - low <= kMostCloudColour ? Look::kCloud : Look::kOther;
}

// Points whose place is known: some views see them from different sides.
std::vector<Eigen::Vector3d> SurePoints(const io::Scene& scene) {
  std::vector<Eigen::Vector3d> points;
  for (const io::Point3D& point : scene.points) {
    if (point.frame_indices.size() < kSureObservers) continue;
    const auto ray = [&](int frame) {
      return (point.xyz - scene.frames[static_cast<std::size_t>(frame)].world_from_cam.translation)
          .normalized();
    };
    const Eigen::Vector3d first = ray(point.frame_indices.front());
    double cosine = 1;
    for (const int frame : point.frame_indices) cosine = std::min(cosine, first.dot(ray(frame)));
    if (std::acos(std::max(-1.0, cosine)) >= kMinParallax) points.push_back(point.xyz);
  }
  return points;
}

class ViewSky {
 public:
  ViewSky(const io::Scene& scene, const Dataset& dataset, std::size_t index)
      : view_(dataset.views[index]),
        frame_(scene.frames[index]),
        camera_(scene.cameras[static_cast<std::size_t>(frame_.camera_index)]),
        pixels_(&dataset.pixels[3 * view_.first_pixel]),
        cell_(std::max(2, std::max(view_.width, view_.height) / kCells)),
        columns_((view_.width + cell_ - 1) / cell_),
        rows_((view_.height + cell_ - 1) / cell_),
        occupied_(static_cast<std::size_t>(columns_ * rows_)),
        seen_(view_.n_pixels()) {}

  void Occupy(const std::vector<Eigen::Vector3d>& points) {
    const io::Rigid3d cam_from_world = frame_.world_from_cam.Inverse();
    for (const Eigen::Vector3d& point : points) {
      const auto xy = io::ImgFromCam(camera_, cam_from_world * point);
      if (!xy || !(xy->x() >= 0 && xy->y() >= 0 && xy->x() < view_.width && xy->y() < view_.height)) continue;
      const int column = static_cast<int>(xy->x()) / cell_, row = static_cast<int>(xy->y()) / cell_;
      for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r) {
        for (int c = std::max(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c)
          occupied_[static_cast<std::size_t>(r * columns_ + c)] = true;
      }
    }
  }

  // Whether each pixel shows the sky; empty: none does.
  std::vector<bool> Find(const Eigen::Vector3d& up) {
    up_in_cam_ = frame_.world_from_cam.rotation.transpose() * up;
    std::vector<bool> sky;
    for (int x = 0; x < view_.width; ++x) {
      const std::vector<std::size_t> region = RegionFrom(x);
      if (!IsSky(region)) continue;
      sky.resize(view_.n_pixels());
      for (const std::size_t i : region) sky[i] = true;
    }
    return sky;
  }

 private:
  // Pixels that look like sky and that small steps lead to from pixel x of the upper edge; none twice.
  std::vector<std::size_t> RegionFrom(int x) {
    std::vector<std::size_t> region;
    Add(x, 0, &region);
    for (std::size_t next = 0; next < region.size(); ++next) {
      const int px = X(region[next]), py = Y(region[next]);
      for (const auto& [nx, ny] : {std::pair{px + 1, py}, {px - 1, py}, {px, py + 1}, {px, py - 1}}) {
        if (nx < 0 || ny < 0 || nx >= view_.width || ny >= view_.height) continue;
        if (Step(region[next], Index(nx, ny)) <= kMostStep) Add(nx, ny, &region);
      }
    }
    return region;
  }

  void Add(int x, int y, std::vector<std::size_t>* region) {
    const std::size_t i = Index(x, y);
    if (seen_[i] || occupied_[static_cast<std::size_t>(y / cell_ * columns_ + x / cell_)] ||
        LookOf(pixels_ + 3 * i) == Look::kOther)
      return;
    seen_[i] = true;
    region->push_back(i);
  }

  bool IsSky(const std::vector<std::size_t>& region) const {
    const auto n = static_cast<double>(region.size());
    if (n < kLeastShare * static_cast<double>(view_.n_pixels())) return false;
    const auto apart = static_cast<std::size_t>(cell_);
    double clear = 0, below = 0, contrast = 0, n_pairs = 0;
    for (const std::size_t i : region) {
      clear += LookOf(pixels_ + 3 * i) == Look::kClear;
      below += Elevation(i) < kBelow;
      if (X(i) < cell_ || !seen_[i - apart]) continue;
      contrast += Step(i, i - apart);
      ++n_pairs;
    }
    return clear >= kLeastClear * n && below <= kMostBelow * n && contrast <= kMostContrast * n_pairs;
  }

  // Sine of the angle above the horizon.
  double Elevation(std::size_t i) const {
    const Eigen::Vector3d ray(
        (X(i) + 0.5 - camera_.cx) / camera_.fl_x, -(Y(i) + 0.5 - camera_.cy) / camera_.fl_y, -1);
    return ray.normalized().dot(up_in_cam_);
  }
  int Step(std::size_t a, std::size_t b) const {
    int step = 0;
    for (std::size_t c = 0; c < 3; ++c)
      step = std::max(step, std::abs(pixels_[3 * a + c] - pixels_[3 * b + c]));
    return step;
  }
  int X(std::size_t i) const { return static_cast<int>(i) % view_.width; }
  int Y(std::size_t i) const { return static_cast<int>(i) / view_.width; }
  std::size_t Index(int x, int y) const { return static_cast<std::size_t>(y * view_.width + x); }

  const View& view_;
  const io::Frame& frame_;
  const io::Camera& camera_;
  const std::uint8_t* pixels_;
  const int cell_, columns_, rows_;
  std::vector<bool> occupied_, seen_;
  Eigen::Vector3d up_in_cam_;
};

}  // namespace

std::vector<bool> FindSky(const io::Scene& scene, const Dataset& dataset, io::Workers* workers) {
  const Eigen::Vector3d up = MeasureCapture(scene).up;
  const std::vector<Eigen::Vector3d> points = SurePoints(scene);
  std::vector<std::vector<bool>> found(dataset.views.size());
  workers->Run(static_cast<int>(found.size()), [&](int index, int) {
    ViewSky view(scene, dataset, static_cast<std::size_t>(index));
    view.Occupy(points);
    found[static_cast<std::size_t>(index)] = view.Find(up);
  });
  std::vector<bool> sky;
  for (std::size_t view = 0; view < found.size(); ++view) {
    if (found[view].empty()) continue;
    sky.resize(dataset.n_pixels());
    const auto first = static_cast<std::ptrdiff_t>(dataset.views[view].first_pixel);
    std::copy(found[view].begin(), found[view].end(), sky.begin() + first);
  }
  return sky;
}

}  // namespace nerf
