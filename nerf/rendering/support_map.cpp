#include "nerf/rendering/support_map.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "io/process/parallel.h"
#include "io/process/ranks.h"

namespace nerf {
namespace {

using Eigen::Vector3d;

// Standard deviation of the veil's edge in pixels of the map: a hole that covers fewer than about 8 of them
// across stays below half, where the veil begins. It would look like dirt.
constexpr double kVeilSigma = 3;
// Unobserved share of the surroundings where the veil begins and where it is complete.
constexpr float kVeilBegins = 0.5f, kVeilComplete = 0.9f;

// Gaussian mean along rows or columns of values [height][width]; beyond the border the border goes on.
std::vector<float> Blurred(const std::vector<float>& values, int width, int height, bool rows) {
  const int reach = static_cast<int>(std::ceil(3 * kVeilSigma));
  std::vector<float> blurred(values.size());
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double sum = 0, weights = 0;
      for (int k = -reach; k <= reach; ++k) {
        const int u = rows ? std::clamp(x + k, 0, width - 1) : x,
                  v = rows ? y : std::clamp(y + k, 0, height - 1);
        const double weight = std::exp(-0.5 * k * k / (kVeilSigma * kVeilSigma));
        sum += weight * static_cast<double>(values[static_cast<std::size_t>(v * width + u)]);
        weights += weight;
      }
      blurred[static_cast<std::size_t>(y * width + x)] = static_cast<float>(sum / weights);
    }
  }
  return blurred;
}

// Bilinear value at pixel coordinates (x, y) of a map.
float At(const std::vector<float>& values, int width, int height, float x, float y) {
  x = std::clamp(x - 0.5f, 0.f, static_cast<float>(width - 1));
  y = std::clamp(y - 0.5f, 0.f, static_cast<float>(height - 1));
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, width - 1), y1 = std::min(y0 + 1, height - 1);
  const float u = x - static_cast<float>(x0), v = y - static_cast<float>(y0);
  const auto value = [&](int column, int row) {
    return values[static_cast<std::size_t>(row * width + column)];
  };
  return (1 - v) * ((1 - u) * value(x0, y0) + u * value(x1, y0)) +
         v * ((1 - u) * value(x0, y1) + u * value(x1, y1));
}

float VeilAt(float unobserved_share) {
  const float u = std::clamp((unobserved_share - kVeilBegins) / (kVeilComplete - kVeilBegins), 0.f, 1.f);
  return u * u * (3 - 2 * u);
}

void Cover(float veil, const std::array<float, 3>& tone, float rgb[3]) {
  for (std::size_t j = 0; j < 3; ++j) rgb[j] += veil * (tone[j] - rgb[j]);
}

float LargestAngle(const std::vector<Vector3d>& directions) {
  double least_cosine = 1;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    for (std::size_t j = i + 1; j < directions.size(); ++j)
      least_cosine = std::min(least_cosine, directions[i].dot(directions[j]));
  }
  return static_cast<float>(std::acos(std::clamp(least_cosine, -1.0, 1.0)));
}

}  // namespace

double PixelAngle(const io::Camera& camera) { return 1 / std::sqrt(camera.fl_x * camera.fl_y); }

io::Camera SmallCamera(const io::Camera& camera, int side) {
  const double scale = std::min(1.0, static_cast<double>(side) / std::max(camera.width, camera.height));
  return io::ResizedCamera(camera,
                           std::max(1, static_cast<int>(std::lround(scale * camera.width))),
                           std::max(1, static_cast<int>(std::lround(scale * camera.height))));
}

double ViewSupport::UnobservedShare() const {
  const auto n = std::count(observed.begin(), observed.end(), 0);
  return static_cast<double>(n) / static_cast<double>(std::max<std::size_t>(1, observed.size()));
}

SupportMap::SupportMap(const TrainedField& field, const io::Scene& train, int threads) {
  RenderOptions options{.threads = threads, .step_scale = 1, .samples_per_pixel = 1, .depth_only = true};
  for (const io::Frame& frame : train.frames) {
    const io::Camera& full = train.cameras[static_cast<std::size_t>(frame.camera_index)];
    SeenDepth view{.camera = SmallCamera(full, kMaxSide),
                   .world_from_cam = frame.world_from_cam,
                   .cam_from_world = frame.world_from_cam.Inverse(),
                   .mask = {},
                   .depth = {}};
    if (!frame.mask_path.empty()) {
      view.mask = io::ShrinkMask(
          io::ReadMask(frame.mask_path, full.width, full.height), view.camera.width, view.camera.height);
    }
    views_.push_back(std::move(view));
  }
  std::vector<std::string> depths(views_.size());
  for (const std::size_t v : io::OwnTasks(views_.size())) {
    views_[v].depth = field.Render(views_[v].camera, views_[v].world_from_cam, options).depth;
    depths[v].assign(reinterpret_cast<const char*>(views_[v].depth.data()),
                     views_[v].depth.size() * sizeof(float));
  }
  io::GatherTasks(&depths);
  for (std::size_t v = 0; v < views_.size(); ++v) {
    views_[v].depth.resize(depths[v].size() / sizeof(float));
    depths[v].copy(reinterpret_cast<char*>(views_[v].depth.data()), depths[v].size());
  }
}

void SupportMap::Look(const SeenDepth& view, const Place& place, bool* supports, bool* observes) {
  *supports = *observes = false;
  const Vector3d in_cam = view.cam_from_world * place.point;
  const auto xy = io::ImgFromCam(view.camera, in_cam);
  const int width = view.camera.width, height = view.camera.height;
  if (!xy || !(xy->x() >= 0 && xy->y() >= 0 && xy->x() < width && xy->y() < height)) return;
  if (!view.mask.Uses(
          static_cast<std::size_t>(static_cast<int>(xy->y()) * width + static_cast<int>(xy->x()))))
    return;
  const double distance = in_cam.norm(), tolerance = kFootprints * PixelAngle(view.camera) * distance;
  const Vector3d ray = (place.point - view.world_from_cam.translation) / distance;
  const Vector3d from_film = (place.point - place.film_centre).normalized();
  // The four pixels around the point: at an edge, any of them may be the one that shows it.
  const int x0 = static_cast<int>(xy->x() - 0.5), y0 = static_cast<int>(xy->y() - 0.5);
  for (int y = y0; y <= std::min(y0 + 1, height - 1); ++y) {
    for (int x = x0; x <= std::min(x0 + 1, width - 1); ++x) {
      const double depth = static_cast<double>(view.depth[static_cast<std::size_t>(y * width + x)]);
      if (depth >= distance - std::max(tolerance, kBehindShare * distance)) *observes = true;
      bool agrees = std::abs(depth - distance) <= tolerance;
      if (!agrees) {
        // Far away, depths that differ show the same: for the film, which looks from the same side, the two
        // places are closer than pixels.
        const Vector3d seen = view.world_from_cam.translation + depth * ray - place.film_centre;
        agrees = seen.normalized().cross(from_film).norm() <= kFootprints * place.pixel_angle &&
                 seen.dot(from_film) > 0 && ray.dot(from_film) > 0;
      }
      if (agrees) *supports = *observes = true;
    }
  }
}

std::vector<SupportMap::Place> SupportMap::Places(const io::Camera& small,
                                                  const io::Rigid3d& world_from_cam,
                                                  const RenderedView& view) {
  std::vector<Place> places;
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      const Vector3d ray = world_from_cam.rotation * *io::RayFromImg(small, {x + 0.5, y + 0.5});
      const int column = std::min(view.width - 1, static_cast<int>((x + 0.5) * view.width / small.width)),
                row = std::min(view.height - 1, static_cast<int>((y + 0.5) * view.height / small.height));
      const double depth = view.depth[static_cast<std::size_t>(row * view.width + column)];
      places.push_back(
          {world_from_cam.translation + depth * ray, world_from_cam.translation, PixelAngle(small)});
    }
  }
  return places;
}

ViewSupport SupportMap::Of(const io::Camera& camera,
                           const io::Rigid3d& world_from_cam,
                           const RenderedView& view,
                           int threads) const {
  const io::Camera small = SmallCamera(camera, kMaxSide);
  const std::vector<Place> places = Places(small, world_from_cam, view);
  ViewSupport support{.width = small.width, .height = small.height, .views = {}, .angle = {}, .observed = {}};
  support.views.resize(places.size()), support.angle.resize(places.size());
  support.observed.resize(places.size());
  io::Workers(threads).Run(small.height, [&](int y, int) {
    std::vector<Vector3d> directions;
    for (int x = 0; x < small.width; ++x) {
      const auto at = static_cast<std::size_t>(y * small.width + x);
      directions.clear();
      for (const SeenDepth& seen : views_) {
        bool supports, observes;
        Look(seen, places[at], &supports, &observes);
        if (observes) support.observed[at] = 1;
        if (supports) directions.push_back((places[at].point - seen.world_from_cam.translation).normalized());
      }
      support.views[at] = static_cast<std::uint16_t>(std::min<std::size_t>(directions.size(), UINT16_MAX));
      support.angle[at] = LargestAngle(directions);
    }
  });
  return support;
}

ViewSupport SupportMap::ObservedIn(const io::Camera& camera,
                                   const io::Rigid3d& world_from_cam,
                                   const RenderedView& view,
                                   int threads) const {
  const io::Camera small = SmallCamera(camera, kMaxSide);
  const std::vector<Place> places = Places(small, world_from_cam, view);
  ViewSupport support{.width = small.width, .height = small.height, .views = {}, .angle = {}, .observed = {}};
  support.observed.resize(places.size());
  io::Workers(threads).Run(small.height, [&](int y, int) {
    std::size_t last = 0;  // the view that observed the pixel before is likely to observe this one
    for (int x = 0; x < small.width; ++x) {
      const auto at = static_cast<std::size_t>(y * small.width + x);
      for (std::size_t k = 0; k < views_.size() && !support.observed[at]; ++k) {
        const std::size_t candidate = (last + k) % views_.size();
        bool supports, observes;
        Look(views_[candidate], places[at], &supports, &observes);
        if (!observes) continue;
        support.observed[at] = 1;
        last = candidate;
      }
    }
  });
  return support;
}

int SupportMap::ViewsOf(const Vector3d& point, const Vector3d& centre, double pixel_angle) const {
  return static_cast<int>(std::count_if(views_.begin(), views_.end(), [&](const SeenDepth& view) {
    bool supports, observes;
    Look(view, {point, centre, pixel_angle}, &supports, &observes);
    return supports;
  }));
}

void VeilUnobserved(const ViewSupport& support,
                    const std::array<float, 3>& tone,
                    bool is_cropped,
                    RenderedView* view) {
  const int width = support.width, height = support.height;
  std::vector<float> unobserved(support.observed.size());
  for (std::size_t i = 0; i < unobserved.size(); ++i) unobserved[i] = support.observed[i] ? 0.f : 1.f;
  unobserved = Blurred(Blurred(unobserved, width, height, true), width, height, false);
  const float scale_x = static_cast<float>(width) / static_cast<float>(view->width),
              scale_y = static_cast<float>(height) / static_cast<float>(view->height);
  for (int y = 0; y < view->height; ++y) {
    for (int x = 0; x < view->width; ++x) {
      const float share = At(unobserved,
                             width,
                             height,
                             scale_x * (static_cast<float>(x) + 0.5f),
                             scale_y * (static_cast<float>(y) + 0.5f));
      const float veil = VeilAt(share);
      if (veil == 0) continue;
      const auto pixel = static_cast<std::size_t>(y * view->width + x);
      Cover(veil * (is_cropped ? view->opacity[pixel] : 1), tone, &view->rgb[3 * pixel]);
    }
  }
}

void VeilUnlearnt(const std::array<float, 3>& tone, RenderedView* view) {
  for (std::size_t i = 0; i < view->unlearnt.size(); ++i)
    Cover(VeilAt(view->unlearnt[i]), tone, &view->rgb[3 * i]);
}

}  // namespace nerf
