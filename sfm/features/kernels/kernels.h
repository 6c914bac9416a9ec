// Brute-force nearest neighbours of 8-bit descriptors: the arithmetic of matching two pictures.
//
// For every row a_i of one set and every row b_j of another (128 bytes each) the kernel needs
//   d2(i, j) = |a_i|^2 + |b_j|^2 - 2 a_i . b_j
// and from it the nearest b of each a, the nearest a of each b, and both second distances.
//
// Least work: n_a * n_b * 128 multiply-adds of bytes; one pair of pictures with 8,500 features each is 9.2e9.
// All else (the two running minima, 10 instructions per 16 distances against 32 dot products) is overhead.
//
// Everything is integer and exact: every build returns the same bytes as NearestReference below.
//
// Layout: rows are swept in micro-tiles of kRowTile against panels of 4 registers of columns. Columns are
// interleaved in steps of a few bytes, so that one register holds the same dimensions of 8 or 16 descriptors;
// a panel (8 KiB) stays in the first-level cache, the rows (256 KiB per tile) in the second. The index of a
// candidate rides in the low bits of its distance, hence the limits below.
#pragma once

#include <cstdint>
#include <vector>

namespace sfm::kernels {

constexpr int kDimensions = 128;

// Squared lengths must be smaller: sums of two then leave 11 bits of an int32 for the index. RootSIFT rows
// have 512^2 = 2^18, give or take rounding.
constexpr std::int32_t kMaxSquaredNorm = (1 << 19) - 1;
// 2^11 registers of at least 8 columns.
constexpr int kMaxDescriptors = 16384;

struct Neighbour {
  std::int32_t index = -1;                      // lowest index of the nearest; -1 when the other set is empty
  std::int32_t distance = 2 * kMaxSquaredNorm;  // squared
  std::int32_t second = 2 * kMaxSquaredNorm;    // to the second nearest; as initialised when there is none
  bool operator==(const Neighbour&) const = default;
};

// A set of descriptors in the layout of one build. Filled by Kernel::prepare, read by the same kernel only.
struct Prepared {
  int count = 0;
  std::vector<std::uint8_t> rows, columns;
  std::vector<std::int32_t> norms, sums;  // squared length and sum of each descriptor
};

struct Kernel {
  const char* name;
  // descriptors: count x 128 bytes. Throws std::invalid_argument beyond the limits above.
  Prepared (*prepare)(const std::uint8_t* descriptors, int count);
  // from_a: a.count entries, from_b: b.count entries.
  void (*nearest)(const Prepared& a, const Prepared& b, Neighbour* from_a, Neighbour* from_b);
  // Measures what one core can do at most: multiply-adds of bytes per second on registers alone.
  double (*measure_peak)();
};

// "avx512" (needs VNNI), "avx2" or "portable"; nullptr when this machine cannot run it.
const Kernel* FindKernel(const char* name);

// The fastest of them, or the one the environment variable PIPELINE_SIMD names.
const Kernel& ActiveKernel();

// The same in plain loops.
void NearestReference(
    const std::uint8_t* a, int n_a, const std::uint8_t* b, int n_b, Neighbour* from_a, Neighbour* from_b);

}  // namespace sfm::kernels
