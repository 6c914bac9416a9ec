// bfloat16 one value at a time, for the reference kernels and the tests.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "nerf/kernels/kernels.h"

namespace nerf::kernels::reference {

// The nearest bfloat16, ties to even; a NaN stays one.
inline Bf16 Rounded(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  if (std::isnan(value)) return Bf16{static_cast<std::uint16_t>(bits >> 16 | 0x40)};
  return Bf16{static_cast<std::uint16_t>((bits + 0x7fff + (bits >> 16 & 1)) >> 16)};
}
inline float Value(Bf16 value) { return std::bit_cast<float>(static_cast<std::uint32_t>(value) << 16); }
inline float Value(float value) { return value; }

}  // namespace nerf::kernels::reference
