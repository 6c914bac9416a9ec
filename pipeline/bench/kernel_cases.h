// The kernels of the `hash` field on the working sets of training, SSIM, and what this machine can do at
// most, as cases to be timed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nerf/kernels/aligned_vector.h"
#include "nerf/kernels/kernels.h"
#include "pipeline/bench/kernel_case.h"

namespace pipeline {

// Levels of the grid that are looked up: 2^14 to 2^19 entries.
inline constexpr int kMinLog2Entries = 14, kMaxLog2Entries = 19;
// The level that the optimiser steps through: the trainer's largest.
inline constexpr int kStepLog2Entries = 18;

// Names of the limits, which the kernels' cases refer to. Memory is the same for all builds.
inline constexpr const char *kAnyBuild = "any", *kArithmetic = "multiply-add", *kGather = "gather",
                            *kUpdate = "update", *kStreamRead = "stream read",
                            *kStreamUpdate = "stream update";
// " 2^14"
std::string Power(int log2_entries);

// Memory that the cases work on. Must outlive them.
struct KernelData {
  KernelData();

  nerf::AlignedVector<float> x, y, z;          // positions in [0, 1], along rays
  nerf::AlignedVector<float> table, gradient;  // of the largest level
  nerf::AlignedVector<nerf::kernels::Bf16> rounded;
  nerf::AlignedVector<float> dense, sparse;  // gradients that the optimiser gets
  nerf::AlignedVector<float> step_gradient, m, v, values;
  nerf::AlignedVector<nerf::kernels::Bf16> step_rounded;
  nerf::AlignedVector<float> stream;  // larger than the caches
  nerf::AlignedVector<float> sums;    // of the arithmetic probes
  volatile std::uint64_t used = 0;    // what would otherwise be optimised away
  volatile double ssim = 0;           // likewise
};

// Arithmetic of each of the builds, and memory.
std::vector<KernelCase> LimitCases(const std::vector<std::string>& builds, KernelData* data);
// Every kernel of one build, in float and in Bf16.
std::vector<KernelCase> FieldKernelCases(const std::string& build, KernelData* data);
// SSIM, which evaluation takes of every view: held against no limit.
KernelCase SsimCase(KernelData* data);

}  // namespace pipeline
