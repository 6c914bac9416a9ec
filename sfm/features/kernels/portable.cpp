// No instruction set assumed.
#include <cstdint>
#include <cstring>

namespace sfm::kernels {
namespace {

constexpr int kLanes = 8, kStep = 2, kColumnShift = 0;
constexpr int kRowTile = 2, kPanelRegisters = 1;  // SSE2 needs two of its 16 registers for each
using RowElement = std::int16_t;
using ColumnElement = std::int16_t;
using Ints = std::int32_t __attribute__((vector_size(32)));

inline Ints Dot(Ints sum, Ints row, Ints column) {
  // Sign-extended halves of each lane.
  return sum + ((row << 16) >> 16) * ((column << 16) >> 16) + (row >> 16) * (column >> 16);
}

}  // namespace
}  // namespace sfm::kernels

#define KERNEL_NAME "portable"
#define KERNEL_TABLE kPortableKernel
#include "sfm/features/kernels/nearest.inc"
