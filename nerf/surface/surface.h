// The surface of a trained field as a triangle mesh with colours and normals.
//
// Depth is rendered at every training view and fused into a signed distance (depth_fusion.h), whose zero set
// (isosurface.h) loses what fewer than two views see and what is small and alone (mesh_repair.h), and is
// moved to the sparse points near it (point_fit.h). Density itself has no level at which its surface is
// clean: nerf/EXPERIMENTS.md has the figures of both.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/scene/mesh.h"
#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"

namespace nerf {

struct SurfaceOptions {
  int threads = 1;
  std::optional<io::Aabb> box;  // scene units; nothing: what the capture looks at, see CaptureBox
  // Side of a cell of the lattice, scene units; 0: the footprint of a pixel at the centre of the box, and at
  // least kFinestShare of the box's longest side.
  double voxel = 0;
  std::size_t triangles = 500000;  // at most, see Decimate in mesh_repair.h
  int least_views = 2;             // that must see each vertex
  double least_piece = 1e-3;       // share of the mesh's area that a piece on its own must have
  // What is being done, and the share of it that is done.
  std::function<void(const char* what, double share)> progress;
};

inline constexpr double kFinestShare = 1.0 / 1024;

struct Surface {
  io::Mesh mesh;  // scene units, z up
  io::Aabb box;
  double voxel = 0, area = 0;                  // scene units; area of the mesh
  std::size_t blocks = 0;                      // of 8^3 samples, 4 KiB each while views are fused
  std::size_t extracted_triangles = 0;         // of the zero set in the box
  std::size_t unseen_triangles = 0;            // that too few views see
  int pieces = 0;                              // dropped
  std::size_t decimated_triangles = 0;         // dropped by decimation
  std::size_t fitted_points = 0;               // sparse points that the mesh was moved to (point_fit.h)
  double point_offset_px = 0;                  // how far before it they lay, pixels' footprints; median
  std::vector<std::string> Decisions() const;  // one line each
};

// train: the training views, whose poses the field was trained with. Throws kBadInput when no surface in the
// box is seen by enough views, or the box or an option is impossible; io::Interrupted.
Surface ExtractSurface(const TrainedField& field, const io::Scene& train, const SurfaceOptions& options);

// The region that the capture looks at: scene.aabb, which normalisation put around the subject; but where the
// space is unbounded and most cameras do not look at one place, as in a walk through rooms, the box of the
// middle 96 % of the sparse points along each axis.
io::Aabb CaptureBox(const io::Scene& train);

}  // namespace nerf
