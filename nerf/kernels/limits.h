// What one core can do at most: the yardsticks that `pipeline bench kernels` holds the kernels against. Each
// probe does a known amount of work in independent chains; callers time it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "nerf/kernels/kernels.h"

namespace nerf::kernels {

// Sums that an arithmetic probe reads and writes: at most 16 chains of 16 lanes. They must differ from each
// other: the compiler would compute equal chains once.
inline constexpr int kProbeSums = 256;

// Multiply-adds on registers alone, with a build's own instructions.
struct ArithmeticProbe {
  // Floating-point operations per second follow from the returned number of them: two per multiply-add.
  double (*fp32)(int rounds, float* sums);
  double (*bf16)(int rounds, float* sums);  // nullptr where the build has no products of bfloat16
};

// Of a build that FindKernels knows; nullptr when this CPU lacks it.
const ArithmeticProbe* FindArithmeticProbe(const char* name);

// Random accesses to the entries of a table, of kFeatures values each. `mask` + 1 entries, a power of two
// and at least kPicks; picks: kPicks random entries, which every round moves elsewhere. rounds * kPicks
// accesses.
inline constexpr int kPicks = 1024;
std::uint64_t GatherEntries(const float* table, std::uint32_t mask, const std::uint32_t* picks, int rounds);
std::uint64_t GatherEntries(const Bf16* table, std::uint32_t mask, const std::uint32_t* picks, int rounds);
void UpdateEntries(float* table, std::uint32_t mask, const std::uint32_t* picks, int rounds);

// From one end to the other; n is a multiple of 16. The sum is returned so that the compiler keeps the work.
std::uint64_t StreamRead(std::size_t n, const float* values);
void StreamUpdate(std::size_t n, float* values);  // reads and writes each value

}  // namespace nerf::kernels
