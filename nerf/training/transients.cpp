#include "nerf/training/transients.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "io/base/median.h"
#include "io/process/interrupt.h"
#include "nerf/rendering/ray_renderer.h"
#include "nerf/rendering/support_map.h"

namespace nerf {
namespace {

// Longer side of the small pictures: smaller where more than so many views would take long.
constexpr int kSide = 128, kLeastSide = 64;
constexpr double kViewsAtFullSide = 100;
// Suspect is what differs by this much, of sRGB in [0, 1], by so many times as much as pixels usually do, and
// as the surface does in other views.
constexpr float kSuspectError = 0.05f, kOverUsual = 3, kOverOthers = 3;
// Fewer views decide nothing, more are not asked. They see the same surface where their depth is the same but
// for this share: half-trained surfaces are rough.
constexpr std::size_t kFewestOthers = 3, kMostOthers = 12;
constexpr double kSameDepth = 0.1;
// What touches a transient joins it from so many times the least suspect difference on.
constexpr float kTouching = 2;
// What makes suspects a transient: how many they are, as a share of their picture, how much they differ where
// they differ most, and the correlation of slopes.
constexpr double kLeastPatchShare = 0.003, kMostCorrelation = 0.3;
constexpr float kStrongError = 0.3f;
// What the field shows as well, but up to this part of the longer side beside, is none. It correlates there,
// and differs by no more than this share of the squared difference in place: ghosts of someone who walks by
// differ by most of it.
constexpr int kShiftsOfSide = 32;
constexpr double kLeastCorrelationBeside = 0.2, kMostDifferenceBeside = 0.6;
// Pixels of the small picture by which gaps in a transient are closed.
constexpr int kClose = 2;
// Every so many pixels tell what is usual.
constexpr std::size_t kUsualStride = 7;

struct SmallPose {
  io::Camera camera;
  io::Rigid3d world_from_cam, cam_from_world;
};

struct SmallView {
  SmallPose pose;
  cv::Mat3b photo, rendering;
  cv::Mat1f error;  // e
  cv::Mat1f depth;  // of the surface; infinite where there is none, and where the picture is not used
};

cv::Mat3b SmallPhoto(const Dataset& dataset, const View& view, const cv::Size& size) {
  const cv::Mat photo(
      view.height, view.width, CV_8UC3, const_cast<std::uint8_t*>(&dataset.pixels[3 * view.first_pixel]));
  cv::Mat3b small;
  cv::resize(photo, small, size, 0, 0, cv::INTER_AREA);
  return small;
}

// e, without the picture's own tint: the median difference in each channel.
cv::Mat1f ErrorOf(const cv::Mat3b& photo, const cv::Mat3b& rendering) {
  cv::Mat difference;
  cv::subtract(photo, rendering, difference, cv::noArray(), CV_32F);
  std::vector<cv::Mat1f> channels;
  cv::split(difference / 255, channels);
  cv::Mat1f squares = cv::Mat1f::zeros(photo.size());
  for (cv::Mat1f& channel : channels) {
    channel -= io::Median(std::vector<float>(channel.begin(), channel.end()));
    cv::blur(channel, channel, {3, 3});
    squares += channel.mul(channel) / 3;
  }
  cv::sqrt(squares, squares);
  return squares;
}

SmallView Render(const Dataset& dataset,
                 const View& view,
                 const SmallPose& pose,
                 const std::vector<bool>& used,
                 const SceneField& scene_field,
                 io::Workers* workers) {
  const cv::Size size(pose.camera.width, pose.camera.height);
  SmallView small{pose, SmallPhoto(dataset, view, size), cv::Mat3b(size), {}, cv::Mat1f(size)};
  const RayCamera ray_camera(pose.camera, pose.world_from_cam, scene_field.field->pixel_offset());
  std::vector<CameraPixel> pixels;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) pixels.push_back({&ray_camera, x, y});
  }
  const std::vector<RenderedRay> rays = RenderPixels(scene_field, pixels, 1, scene_field.step_scale, workers);
  const std::array<float, 3> background = scene_field.Background(false, {0, 0, 0});
  for (std::size_t i = 0; i < rays.size(); ++i) {
    cv::Vec3b& colour = small.rendering(pixels[i].y, pixels[i].x);
    for (std::size_t c = 0; c < 3; ++c) {
      const float level = rays[i].rgb[c] + rays[i].transmittance * background[c];
      colour[static_cast<int>(c)] = cv::saturate_cast<std::uint8_t>(255 * level);
    }
    small.depth(pixels[i].y, pixels[i].x) = rays[i].median_depth;
  }
  small.error = ErrorOf(small.photo, small.rendering);
  for (int y = 0; y < size.height && !used.empty(); ++y) {
    for (int x = 0; x < size.width; ++x) {
      const auto column = static_cast<std::size_t>((x * view.width) / size.width),
                 row = static_cast<std::size_t>((y * view.height) / size.height);
      if (!used[view.first_pixel + row * static_cast<std::size_t>(view.width) + column])
        small.depth(y, x) = std::numeric_limits<float>::infinity();
    }
  }
  return small;
}

// A step through n views in a circle that meets each once, and any few of them far from one another.
std::size_t SpreadStride(std::size_t n) {
  auto stride = static_cast<std::size_t>(0.618 * static_cast<double>(n));
  while (std::gcd(stride, n) != 1) ++stride;
  return stride;
}

// e of the surface at `point` in other views of the same surface. They are taken from all of the capture:
// those of a video that were taken next may show the same passer-by.
std::vector<float> ErrorsOfOthers(const std::vector<SmallView>& views,
                                  std::size_t own,
                                  const Eigen::Vector3d& point) {
  std::vector<float> errors;
  const std::size_t n = views.size(), stride = SpreadStride(n);
  for (std::size_t k = 1; k < n && errors.size() < kMostOthers; ++k) {
    const SmallView& view = views[(own + k * stride) % n];
    const Eigen::Vector3d in_cam = view.pose.cam_from_world * point;
    const auto xy = io::ImgFromCam(view.pose.camera, in_cam);
    if (!xy || !(xy->x() >= 0 && xy->y() >= 0 && xy->x() < view.depth.cols && xy->y() < view.depth.rows))
      continue;
    const int x = static_cast<int>(xy->x()), y = static_cast<int>(xy->y());
    const double distance = in_cam.norm();
    if (std::abs(static_cast<double>(view.depth(y, x)) - distance) < kSameDepth * distance)
      errors.push_back(view.error(y, x));
  }
  return errors;
}

cv::Mat1b Suspects(const std::vector<SmallView>& views,
                   std::size_t own,
                   float least_error,
                   double pixel_offset) {
  const SmallView& view = views[own];
  const RayCamera ray_camera(view.pose.camera, view.pose.world_from_cam, pixel_offset);
  cv::Mat1b suspects = cv::Mat1b::zeros(view.error.size());
  for (int y = 0; y < suspects.rows; ++y) {
    for (int x = 0; x < suspects.cols; ++x) {
      const float error = view.error(y, x);
      if (error < least_error || !std::isfinite(view.depth(y, x))) continue;
      const Ray ray = ray_camera.RayThrough(x, y);
      Eigen::Vector3d point;
      for (int k = 0; k < 3; ++k) point[k] = ray.origin[k] + view.depth(y, x) * ray.direction[k];
      std::vector<float> others = ErrorsOfOthers(views, own, point);
      if (others.size() >= kFewestOthers && error >= kOverOthers * io::Median(std::move(others)))
        suspects(y, x) = 255;
    }
  }
  return suspects;
}

// The sums of the equation in transients.h.
struct Slopes {
  double photo = 0, rendering = 0, both = 0;

  void Add(const cv::Vec3b& photo_a,
           const cv::Vec3b& photo_b,
           const cv::Vec3b& rendering_a,
           const cv::Vec3b& rendering_b) {
    for (int c = 0; c < 3; ++c) {
      const double p = photo_b[c] - photo_a[c], r = rendering_b[c] - rendering_a[c];
      photo += p * p, rendering += r * r, both += p * r;
    }
  }
  // A rendering without any slope has no texture in common.
  double Correlation() const { return rendering > 0 && photo > 0 ? both / std::sqrt(photo * rendering) : 0; }
};

// Of connected suspects.
struct Patch {
  std::vector<cv::Point> pixels;
  float largest_error = 0;
};

// The photograph of a patch beside the shifted rendering.
struct Likeness {
  double correlation = 0;         // of slopes
  double squared_difference = 0;  // mean
};

Likeness Compare(const Patch& patch, const SmallView& view, const cv::Point& shift) {
  const cv::Mat3b &photo = view.photo, &rendering = view.rendering;
  const cv::Rect inside(0, 0, photo.cols - 1, photo.rows - 1);
  const cv::Point right(1, 0), below(0, 1);
  Slopes slopes;
  double squares = 0;
  int n = 0;
  for (const cv::Point& at : patch.pixels) {
    const cv::Point shifted = at + shift;
    if (!inside.contains(at) || !inside.contains(shifted)) continue;
    slopes.Add(photo(at), photo(at + right), rendering(shifted), rendering(shifted + right));
    slopes.Add(photo(at), photo(at + below), rendering(shifted), rendering(shifted + below));
    const cv::Vec3d difference = cv::Vec3d(photo(at)) - cv::Vec3d(rendering(shifted));
    squares += difference.dot(difference), ++n;
  }
  return {slopes.Correlation(), squares / std::max(1, n)};
}

bool IsTransient(const Patch& patch, const SmallView& view) {
  if (static_cast<double>(patch.pixels.size()) < kLeastPatchShare * static_cast<double>(view.photo.total()) ||
      patch.largest_error < kStrongError)
    return false;
  const Likeness in_place = Compare(patch, view, {0, 0});
  if (in_place.correlation >= kMostCorrelation) return false;
  const int most = std::max(view.photo.cols, view.photo.rows) / kShiftsOfSide;
  for (int dy = -most; dy <= most; ++dy) {
    for (int dx = -most; dx <= most; ++dx) {
      const Likeness beside = Compare(patch, view, {dx, dy});
      if (beside.correlation >= kLeastCorrelationBeside &&
          beside.squared_difference <= kMostDifferenceBeside * in_place.squared_difference)
        return false;
    }
  }
  return true;
}

// With what touches them and differs much, whatever other views say of the surface behind.
void Join(const cv::Mat1b& different, cv::Mat1b* transients) {
  cv::Mat1i label;
  const int n_labels = cv::connectedComponents(*transients | different, label);
  std::vector<bool> holds(static_cast<std::size_t>(n_labels), false);
  for (std::size_t i = 0; i < label.total(); ++i) {
    if (transients->ptr()[i] == 1) holds[static_cast<std::size_t>(label.ptr<int>()[i])] = true;
  }
  for (std::size_t i = 0; i < label.total(); ++i)
    transients->ptr()[i] = holds[static_cast<std::size_t>(label.ptr<int>()[i])] ? 1 : 0;
}

// Without gaps and holes, whose colours happen to be those behind, and with a margin.
void Complete(int margin, cv::Mat1b* transients) {
  const auto disc = [](int radius) {
    return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1});
  };
  cv::morphologyEx(*transients, *transients, cv::MORPH_CLOSE, disc(kClose));
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(*transients, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(*transients, outlines, -1, 1, cv::FILLED);
  cv::dilate(*transients, *transients, disc(margin));
}

// 1: shows a transient.
cv::Mat1b TransientsAmong(const cv::Mat1b& suspects, float least_error, int margin, const SmallView& view) {
  cv::Mat1b closed;
  cv::morphologyEx(suspects, closed, cv::MORPH_CLOSE, cv::Mat1b::ones(3, 3));
  cv::Mat1i label;
  std::vector<Patch> patches(static_cast<std::size_t>(cv::connectedComponents(closed, label)));
  for (int y = 0; y < label.rows; ++y) {
    for (int x = 0; x < label.cols; ++x) {
      Patch& patch = patches[static_cast<std::size_t>(label(y, x))];
      patch.pixels.emplace_back(x, y);
      patch.largest_error = std::max(patch.largest_error, view.error(y, x));
    }
  }
  cv::Mat1b found = cv::Mat1b::zeros(label.size());
  for (std::size_t i = 1; i < patches.size(); ++i) {  // 0: what is not suspect
    if (!IsTransient(patches[i], view)) continue;
    for (const cv::Point& pixel : patches[i].pixels) found(pixel) = 1;
  }
  Join(view.error >= kTouching * least_error, &found);
  Complete(margin, &found);
  return found;
}

// From where on a difference is suspect.
float LeastError(const std::vector<SmallView>& views) {
  std::vector<float> errors;
  for (const SmallView& view : views) {
    for (std::size_t i = 0; i < view.error.total(); i += kUsualStride) {
      if (std::isfinite(view.depth.ptr<float>()[i])) errors.push_back(view.error.ptr<float>()[i]);
    }
  }
  return errors.empty() ? kSuspectError : std::max(kSuspectError, kOverUsual * io::Median(std::move(errors)));
}

}  // namespace

io::Camera TransientCamera(const io::Scene& scene, std::size_t view) {
  const double share = std::sqrt(std::min(1.0, kViewsAtFullSide / static_cast<double>(scene.frames.size())));
  const int side = std::max(kLeastSide, static_cast<int>(kSide * share));
  return SmallCamera(scene.cameras[static_cast<std::size_t>(scene.frames[view].camera_index)], side);
}

std::vector<std::uint8_t> FindTransients(const io::Scene& scene,
                                         const std::vector<io::Rigid3d>& world_from_cam,
                                         const Dataset& dataset,
                                         const std::vector<bool>& used,
                                         int margin,
                                         const SceneField& scene_field,
                                         io::Workers* workers) {
  std::vector<SmallView> views;
  for (std::size_t v = 0; v < dataset.views.size(); ++v) {
    io::ThrowIfInterrupted();
    const SmallPose pose{TransientCamera(scene, v), world_from_cam[v], world_from_cam[v].Inverse()};
    views.push_back(Render(dataset, dataset.views[v], pose, used, scene_field, workers));
  }
  const float least_error = LeastError(views);
  std::vector<cv::Mat1b> found(views.size());
  workers->Run(static_cast<int>(views.size()), [&](int index, int) {
    const auto v = static_cast<std::size_t>(index);
    const cv::Mat1b suspects = Suspects(views, v, least_error, scene_field.field->pixel_offset());
    found[v] = TransientsAmong(suspects, least_error, margin, views[v]);
  });
  std::vector<std::uint8_t> shown;
  for (const cv::Mat1b& transients : found) shown.insert(shown.end(), transients.begin(), transients.end());
  if (std::count(shown.begin(), shown.end(), 1) == 0) shown.clear();
  return shown;
}

}  // namespace nerf
