// A trained radiance field read from a checkpoint, and pictures rendered from it.
#pragma once

#include <array>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "io/scene/scene.h"

namespace nerf {

struct RenderOptions {
  int threads = 1;
  // Sampling interval, as a share of the one in training. 0: what is worth its time, 0.5 with one ray per
  // pixel, 0.7 with several, which share the work of finding the surface.
  float step_scale = 0;
  // Rays per pixel: 1, 4, 9, 16, or 0: as the field was trained. Fewer are faster, and jagged.
  int samples_per_pixel = 0;
  // sRGB in [0, 1], shown where rays leave the scene; only used by fields trained on RGBA pictures, whose
  // background is free. Others show their own, plain or learned.
  std::array<float, 3> background = {1, 1, 1};
  // Distance at which rays end: the opacity is then that of what lies nearer.
  float end = std::numeric_limits<float>::infinity();
  // Depth is that of the middle half of the light, see RenderedRay in ray_renderer.h: sharper at edges.
  bool midmean_depth = false;
};

struct RenderedView {
  int width = 0, height = 0;
  std::vector<float> rgb;      // [height][width][3], sRGB in [0, 1], background included
  std::vector<float> depth;    // [height][width], expected (or midmean) depth along the ray in scene units
  std::vector<float> opacity;  // [height][width], sum of weights
};

class TrainedField {
 public:
  // Throws kBadState naming the check that failed.
  static std::unique_ptr<TrainedField> Load(const std::filesystem::path& checkpoint);
  virtual ~TrainedField() = default;

  // camera must be free of distortion. world_from_cam has OpenGL axes.
  virtual RenderedView Render(const io::Camera& camera,
                              const io::Rigid3d& world_from_cam,
                              const RenderOptions& options) const = 0;

  // Whether what no picture shows was left open in training, so that anything may be there: opaque pictures
  // without a plain background. Otherwise it is background.
  virtual bool HasUnknownSpace() const = 0;
};

}  // namespace nerf
