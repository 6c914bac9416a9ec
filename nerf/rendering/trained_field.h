// A trained radiance field read from a checkpoint, and pictures rendered from it.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "io/scene/scene.h"
#include "nerf/rendering/ray_limits.h"
#include "nerf/rendering/rendered_view.h"
#include "nerf/splatting/splats.h"

namespace nerf {

// Sampling interval, as a share of the one in training, that is worth its time: several rays of a pixel share
// the work of finding the surface.
inline float FinestStepScale(int samples_per_pixel) { return samples_per_pixel > 1 ? 0.7f : 0.5f; }

// Under splats, which have the fine structure, the field's picture is drawn with so many times the focal
// length of the training pictures: a quarter of the rays, and pictures no worse for it (EXPERIMENTS.md,
// Rendering).
inline constexpr double kFieldPictureShare = 0.5;

struct RenderOptions {
  int threads = 1;
  // Sampling interval, as a share of the one in training. 0: FinestStepScale.
  float step_scale = 0;
  // Rays per pixel: 1, 4, 9, 16, or 0: as the field was trained. Fewer are faster, and jagged.
  int samples_per_pixel = 0;
  // sRGB in [0, 1], shown where rays leave the scene or the box. Without a box only used by fields trained on
  // RGBA pictures, whose background is free; others show their own, plain or learned.
  std::array<float, 3> background = {1, 1, 1};
  // Where rays end: with a distance, the opacity is that of what lies nearer; with a box, that of what lies
  // inside, before `background`.
  RayLimits limits;
  // Whether the scene's splats, if it has any, are in the colours; not where rays end at a distance. Depth
  // and opacity are the field's.
  bool splats = true;
  // Depth and opacity alone, in a quarter less time: colours are the background's.
  bool depth_only = false;
  // Under splats the field's picture has at most this focal length [px] and is magnified. 0: that of the
  // camera.
  double field_focal_px = 0;
};

// Bytes that a checkpoint's field takes: its tensors with the tables' rounded copies, and the occupancy grid.
std::size_t LoadedFieldBytes(const std::filesystem::path& checkpoint);

// Bytes that rendering a picture takes: the view, a band of rays, splats and the picture before, which is
// written meanwhile. `view` itself is less than half of it.
std::size_t RenderingBytes(const io::Camera& camera, int samples_per_pixel);

class TrainedField {
 public:
  // Throws kBadState naming the check that failed.
  static std::unique_ptr<TrainedField> Load(const std::filesystem::path& checkpoint);
  virtual ~TrainedField() = default;

  // camera must be free of distortion. world_from_cam has OpenGL axes.
  virtual RenderedView Render(const io::Camera& camera,
                              const io::Rigid3d& world_from_cam,
                              const RenderOptions& options) const = 0;

  // The two steps of Render, for who wants the first in parts: the camera of the field's own picture, without
  // splats, and what makes the whole picture of it. The same camera, and nothing, where no splats are shown.
  virtual io::Camera FieldCamera(const io::Camera& camera, const RenderOptions& /*options*/) const {
    return camera;
  }
  virtual void AddSplats(const io::Camera& /*camera*/,
                         const io::Rigid3d& /*world_from_cam*/,
                         const RenderOptions& /*options*/,
                         RenderedView* /*view*/) const {}

  // Whether what no picture shows was left open in training, so that anything may be there: opaque pictures
  // without a plain background. Otherwise it is background.
  virtual bool HasUnknownSpace() const = 0;

  // In scene coordinates; none where training fitted none.
  virtual const Splats& splats() const {
    static const Splats kNone;
    return kNone;
  }

  // Opacity of the splats whose middles are nearer than `distance`, times their share in pictures:
  // [height][width]; empty where there are none.
  virtual std::vector<float> NearSplatOpacity(const io::Camera& /*camera*/,
                                              const io::Rigid3d& /*world_from_cam*/,
                                              double /*distance*/,
                                              int /*threads*/) const {
    return {};
  }

  // sRGB in [0, 1], shown where rays leave the scene: `wanted` where it is free.
  virtual std::array<float, 3> Background(const std::array<float, 3>& wanted) const { return wanted; }
};

}  // namespace nerf
