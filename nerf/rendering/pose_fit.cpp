#include "nerf/rendering/pose_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "io/base/error.h"
#include "nerf/sampling/pose_motion.h"

namespace nerf {
namespace {

// Sizes of the pictures that are compared, as shares of the photograph's, and renders at each.
constexpr double kScales[] = {0.25, 0.5};
constexpr int kMaxRenders = 8;
// Longer sides below this show too little to align.
constexpr int kMinSide = 32;
// Residuals beyond this are taken for content that no motion explains.
constexpr double kHuber = 0.05;
// Steps below this are not worth a render. Pixels of the small picture.
constexpr double kSmallStep_px = 0.01;
// Share of the diagonal added to the normal equations, at first, and its factor after a step that failed.
constexpr double kDamping = 1e-3, kDampingFactor = 10;

// A photograph at one size.
struct Level {
  io::Camera camera;
  io::Image photo;
  io::Mask mask;
};

Level MakeLevel(const io::Camera& camera, const io::Image& photo, const io::Mask& mask, double scale) {
  const auto size = [&](int side) { return std::max(1, static_cast<int>(std::lround(scale * side))); };
  Level level{.camera = io::ResizedCamera(camera, size(camera.width), size(camera.height)),
              .photo = io::ResizeArea(photo, size(camera.width), size(camera.height)),
              .mask = {}};
  if (!mask.used.empty()) level.mask = io::ShrinkMask(mask, level.photo.width, level.photo.height);
  return level;
}

double Cost(double residual) {
  const double r = std::abs(residual);
  return r <= kHuber ? 0.5 * r * r : kHuber * (r - 0.5 * kHuber);
}

// The cost of a pose, its normal equations H x = -g, and the mean of J^T J, by which motions are measured.
struct Normal {
  double cost = 0;
  Matrix6d hessian = Matrix6d::Zero(), flow = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();

  double Pixels(const Vector6d& motion) const { return std::sqrt(motion.dot(flow * motion)); }
};

// Adds a pixel that is not on the border.
void AddPixel(const Level& level, const RenderedView& view, int x, int y, Normal* normal) {
  const int width = level.camera.width;
  const auto at = [&](int dx, int dy) { return static_cast<std::size_t>((y + dy) * width + x + dx); };
  const PixelJacobian j = PixelOfMotion(
      level.camera, PointInCamera(level.camera, x + 0.5, y + 0.5, static_cast<double>(view.depth[at(0, 0)])));
  normal->flow += j.transpose() * j;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto photo = [&](int dx, int dy) { return level.photo.data[3 * at(dx, dy) + c] / 255.0; };
    const double residual = static_cast<double>(view.rgb[3 * at(0, 0) + c]) - photo(0, 0);
    const Vector6d slope = -0.5 * ((photo(1, 0) - photo(-1, 0)) * j.row(0) +  //
                                   (photo(0, 1) - photo(0, -1)) * j.row(1))
                                      .transpose();
    const double weight = std::min(1.0, kHuber / std::max(std::abs(residual), kHuber));
    normal->cost += Cost(residual);
    normal->hessian += weight * slope * slope.transpose();
    normal->gradient += weight * residual * slope;
  }
}

Normal Compare(const TrainedField& field,
               const Level& level,
               const io::Rigid3d& world_from_cam,
               int threads) {
  const RenderedView view =
      field.Render(level.camera,
                   world_from_cam,
                   {.threads = threads, .step_scale = 1, .samples_per_pixel = 1, .splats = false});
  Normal normal;
  double n = 0;
  for (int y = 1; y + 1 < level.camera.height; ++y) {
    for (int x = 1; x + 1 < level.camera.width; ++x) {
      const auto pixel = static_cast<std::size_t>(y * level.camera.width + x);
      // Rays beside a bounded field's space have no depth: background, at no place that moves.
      if (!level.mask.Uses(pixel) || !(view.depth[pixel] > 0)) continue;
      AddPixel(level, view, x, y, &normal);
      n += 1;
    }
  }
  if (n > 0) normal.flow /= n;
  return normal;
}

// Levenberg-Marquardt from `motion` on; returns the best motion and leaves its cost and flow in `best`.
Vector6d FitLevel(const TrainedField& field,
                  const Level& level,
                  const io::Rigid3d& world_from_cam,
                  Vector6d motion,
                  int threads,
                  Normal* best) {
  const auto compare = [&](const Vector6d& x) {
    return Compare(field, level, MovedPose(world_from_cam, x), threads);
  };
  *best = compare(Vector6d::Zero());
  if (!motion.isZero()) {
    const Normal moved = compare(motion);
    if (moved.cost < best->cost)
      *best = moved;
    else
      motion.setZero();
  }
  double damping = kDamping;
  for (int i = 0; i < kMaxRenders; ++i) {
    Matrix6d hessian = best->hessian;
    hessian.diagonal() *= 1 + damping;
    const Vector6d step = -hessian.ldlt().solve(best->gradient);
    if (!step.allFinite() || best->Pixels(step) < kSmallStep_px) break;
    const Normal next = compare(motion + step);
    if (next.cost < best->cost) {
      *best = next;
      motion += step;
      damping /= kDampingFactor;
    } else {
      damping *= kDampingFactor;
    }
  }
  return motion;
}

}  // namespace

FittedPose FitPose(const TrainedField& field,
                   const io::Camera& camera,
                   const io::Rigid3d& world_from_cam,
                   const io::Image& photo,
                   const io::Mask& mask,
                   int threads) {
  if (photo.width != camera.width || photo.height != camera.height || photo.channels != 3)
    throw io::Error(io::ExitCode::kBadInput, "a photograph is not RGB of its camera's size");
  Vector6d motion = Vector6d::Zero();
  double moved_px = 0;
  for (const double scale : kScales) {
    if (scale * std::max(camera.width, camera.height) < kMinSide) continue;
    Normal best;
    motion = FitLevel(field, MakeLevel(camera, photo, mask, scale), world_from_cam, motion, threads, &best);
    moved_px = best.Pixels(motion) / scale;
  }
  return {MovedPose(world_from_cam, motion), moved_px};
}

}  // namespace nerf
