// A training view as the field shows it: a depth and a colour per pixel, and from the depths the small piece
// of surface, the facet, that a pixel shows.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "io/process/parallel.h"
#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"

namespace nerf {

struct DepthView {
  io::Camera camera;
  io::Rigid3d world_from_cam, cam_from_world;
  // [height][width], distance from the camera's plane in scene units; infinite where the ray meets nothing;
  // kUnused where it meets something in part, or its mask leaves it out.
  std::vector<float> depth;
  std::vector<std::uint8_t> rgb;  // [height][width][3], sRGB
  static constexpr float kUnused = -1;
};

// What a pixel shows, in the camera's axes. weight 0: no surface.
struct Facet {
  Eigen::Vector3f point, normal;  // normal: unit length, towards the camera
  float weight;                   // squared cosine between normal and ray, over squared depth
  bool is_empty;                  // the ray meets nothing, nor do those of the pixels around
};

// Opacities between these, such as at an edge of what stands before nothing, say neither how far away
// something is nor that there is nothing.
inline constexpr float kMostEmptyOpacity = 0.1f, kLeastSolidOpacity = 0.9f;
// Neighbouring pixels whose depths differ by more footprints show two surfaces, and a pixel both of whose
// neighbours do so none: the expected depth of an edge lies between the two. 84 degrees of slant.
inline constexpr float kJumpFootprints = 10;
// Longest side of a view, in pixels: finer cells than these views resolve would not fit the memory.
inline constexpr int kMaxViewSide = 800;

// Renders every training view through the centres of its pixels; 7 bytes per pixel stay in memory.
std::vector<DepthView> RenderDepthViews(const TrainedField& field,
                                        const io::Scene& train,
                                        int threads,
                                        const std::function<void(double share)>& progress);

// [height][width].
std::vector<Facet> FacetsOf(const DepthView& view, io::Workers* workers);

}  // namespace nerf
