// How far a mesh of the sample scene lies from the true surface, and how much of that surface it has.
#pragma once

#include <string>
#include <vector>

#include "io/scene/mesh.h"
#include "io/scene/scene.h"
#include "samples/still_life.h"

namespace samples {

// Distance from p to the nearest surface in the room, units of the sample: to where Newton's method arrives
// from p on each signed distance, since some of these underestimate (sdf.h). In creases it may come out too
// large.
double DistanceToSurface(const Vec3& p);

// Of one region; lengths in units of the sample, in which the figurine is 1.3 high and the table 3 wide.
struct MeshFit {
  std::string region;
  std::size_t mesh_points = 0;  // spread evenly over the mesh's area
  double median = 0, q90 = 0;   // of their distances from the true surface
  std::size_t true_points = 0;  // one per cell of a lattice in which two training views see a surface
  double share_within = 0;      // of these, how many have mesh within `reach`
};

struct MeshTruthOptions {
  io::Aabb box;         // of the mesh, in its own frame: what lies outside was not asked for
  double reach = 0.01;  // how near counts as reconstructed, units of the sample
  int threads = 1;
};

// Regions: the things on the table, these with the table top, and all. The mesh is in the frame of `train`,
// the training views; `truth` are the true poses of the capture (truth/transforms.json), and camera centres
// of frames with the same file name align the two. Throws kBadInput when they do not fix an alignment.
std::vector<MeshFit> CompareMesh(const io::Mesh& mesh,
                                 const io::Scene& train,
                                 const io::Scene& truth,
                                 const MeshTruthOptions& options);

}  // namespace samples
