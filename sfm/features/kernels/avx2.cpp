// AVX2: bytes widened to 16 bits, because the byte product of AVX2 saturates; flags are set in
// sfm/CMakeLists.txt.
#include <immintrin.h>

#include <cstdint>

namespace sfm::kernels {
namespace {

constexpr int kLanes = 8, kStep = 2, kColumnShift = 0;
constexpr int kRowTile = 3, kPanelRegisters = 3;  // 9 sums, 3 columns and 1 row of 16 registers
using RowElement = std::int16_t;
using ColumnElement = std::int16_t;
using Ints = std::int32_t __attribute__((vector_size(32)));

inline Ints Dot(Ints sum, Ints row, Ints column) {
  return sum + reinterpret_cast<Ints>(
                   _mm256_madd_epi16(reinterpret_cast<__m256i>(row), reinterpret_cast<__m256i>(column)));
}

}  // namespace
}  // namespace sfm::kernels

#define KERNEL_NAME "avx2"
#define KERNEL_TABLE kAvx2Kernel
#include "sfm/features/kernels/nearest.inc"
