// AVX-512 with VNNI: four bytes per lane and instruction; flags are set in sfm/CMakeLists.txt.
#include <immintrin.h>

#include <cstdint>

namespace sfm::kernels {
namespace {

constexpr int kLanes = 16, kStep = 4, kColumnShift = 128;
constexpr int kRowTile = 6, kPanelRegisters = 4;  // 24 sums, 4 columns and 1 row of 32 registers
using RowElement = std::uint8_t;
using ColumnElement = std::int8_t;
using Ints = std::int32_t __attribute__((vector_size(64)));

// Unsigned row bytes times signed column bytes: exact, nothing saturates in vpdpbusd.
inline Ints Dot(Ints sum, Ints row, Ints column) {
  return reinterpret_cast<Ints>(_mm512_dpbusd_epi32(
      reinterpret_cast<__m512i>(sum), reinterpret_cast<__m512i>(row), reinterpret_cast<__m512i>(column)));
}

}  // namespace
}  // namespace sfm::kernels

#define KERNEL_NAME "avx512"
#define KERNEL_TABLE kAvx512Kernel
#include "sfm/features/kernels/nearest.inc"
