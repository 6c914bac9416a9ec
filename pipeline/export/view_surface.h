// The surface that a view of the field shows: where it is, how it is turned, and which training views saw it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "pipeline/export/exported_scene.h"

namespace pipeline {

// One entry per pixel, row by row.
struct ViewSurface {
  int width = 0, height = 0;
  std::vector<Eigen::Vector3d> rays;     // unit directions in scene coordinates
  std::vector<float> distance;           // along the ray to where half of its light is absorbed; 0: less is
  std::vector<Eigen::Vector3f> normals;  // unit, in scene coordinates, towards the camera; 0: unknown
  // Share of a pixel's neighbours that lie on the same surface, itself among them: below 1 at edges, where
  // the colour is that of both sides.
  std::vector<float> evenness;
  std::vector<std::uint16_t> support;  // training views that saw the same; 0 where the distance is
  std::vector<float> rgb;              // [height][width][3], sRGB in [0, 1]
};

// What lies in the crop box, where the scene has one. Normals are those of planes through a pixel and its
// neighbours on the same surface. Needs scene.field. Throws io::Interrupted.
ViewSurface MeasureSurface(const ExportedScene& scene,
                           const io::Camera& camera,
                           const io::Rigid3d& world_from_cam);

}  // namespace pipeline
