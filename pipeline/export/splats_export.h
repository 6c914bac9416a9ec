// The surface as flat Gaussians, in the PLY layout of the reference implementation of 3D Gaussian Splatting
// (Kerbl et al. 2023): float x y z, nx ny nz, f_dc_0..2, opacity, scale_0..2, rot_0..3. f_dc is
// (colour - 0.5) / 0.28209479177387814, the constant spherical harmonic, opacity a logit, scale the natural
// logarithm of standard deviations, rot the quaternion w x y z that turns the Gaussian's axes, of which the
// third is the normal. Not optimised: opacity and scale follow from the spacing of the points.
#pragma once

#include <filesystem>
#include <vector>

#include "pipeline/export/surfel_grid.h"
#include "pipeline/export/target_frame.h"

namespace pipeline {

// surfels: in scene coordinates. Throws kNoResources.
void ExportSplats(const std::vector<Surfel>& surfels,
                  const TargetFrame& target,
                  const std::filesystem::path& file);

}  // namespace pipeline
