// The scene as 3D Gaussians in the PLY layout of the reference implementation of 3D Gaussian Splatting (Kerbl
// et al. 2023): float x y z, nx ny nz (0), f_dc_0..2, f_rest_0..8, opacity, scale_0..2, rot_0..3. f_dc is the
// constant harmonic's factor for each channel; f_rest has those of degree 1, three of red, of green, of blue;
// what the numbers mean: nerf/splatting/splats.h.
#pragma once

#include <filesystem>

#include "nerf/splatting/splats.h"
#include "pipeline/export/target_frame.h"

namespace pipeline {

// splats: in scene coordinates. Throws kNoResources.
void WriteSplats(const nerf::Splats& splats, const TargetFrame& target, const std::filesystem::path& file);

}  // namespace pipeline
