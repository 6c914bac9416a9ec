#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/base/random.h"
#include "nerf/kernels/limits.h"
#include "pipeline/bench/kernel_cases.h"

namespace pipeline {
namespace {

namespace kernels = nerf::kernels;

constexpr std::size_t kStreamFloats = std::size_t{1} << 25;  // 128 MiB

nerf::AlignedVector<float> Filled(std::size_t n, std::uint64_t seed, float low, float high) {
  nerf::AlignedVector<float> values(n);
  for (std::size_t i = 0; i < n; ++i)
    values[i] = low + (high - low) * io::Random(seed, io::Stream::kInit, 0, i).Uniform();
  return values;
}

// Points every 0.005 along random lines through the unit cube: what a batch of rays looks like.
void FillPositions(KernelData* data) {
  constexpr std::size_t kPositions = 1 << 16;
  constexpr float kStep = 0.005f;
  for (std::uint64_t ray = 0; data->x.size() < kPositions; ++ray) {
    io::Random random(7, io::Stream::kRay, 0, 16 * ray);
    float at[3], step[3], length = 0;
    for (float& value : at) value = random.Uniform();
    for (float& value : step) value = random.Uniform() - 0.5f, length += value * value;
    for (float& value : step) value *= kStep / std::max(std::sqrt(length), 1e-3f);
    const auto inside = [&] {
      return std::all_of(at, at + 3, [](float value) { return value >= 0 && value <= 1; });
    };
    for (; inside() && data->x.size() < kPositions; at[0] += step[0], at[1] += step[1], at[2] += step[2])
      data->x.push_back(at[0]), data->y.push_back(at[1]), data->z.push_back(at[2]);
  }
}

}  // namespace

KernelData::KernelData() {
  constexpr std::size_t kTable = kernels::kFeatures * (std::size_t{1} << kMaxLog2Entries);
  constexpr std::size_t kStep = kernels::kFeatures * (std::size_t{1} << kStepLog2Entries);
  constexpr std::uint32_t kTouched = 10;  // one entry in so many
  FillPositions(this);
  table = Filled(kTable, 1, -1, 1);
  gradient.assign(kTable, 0.f);
  rounded.resize(kTable);
  kernels::ActiveKernels().bf16.round(1, static_cast<int>(kTable), table.data(), rounded.data(), 0);
  dense = sparse = Filled(kStep, 2, 0.5f, 1);
  for (std::size_t i = 0; i < kStep; ++i) {
    if (io::Random(3, io::Stream::kInit, 0, i / kernels::kFeatures).Below(kTouched) != 0) sparse[i] = 0;
  }
  step_gradient.assign(kStep, 0.f), m = v = step_gradient;
  values = Filled(kStep, 4, -1, 1);
  step_rounded.resize(kStep);
  stream.assign(kStreamFloats, 1.f);
  sums = Filled(kernels::kProbeSums, 5, 0.25f, 1);
}

std::string Power(int log2_entries) { return fmt::format(" 2^{}", log2_entries); }

}  // namespace pipeline
