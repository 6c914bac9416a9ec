// Positional encoding [Mildenhall et al. 2020, eq. 4] of a position or a direction p in R^3:
//   gamma(p) = [p,] sin(f_0 p), cos(f_0 p), ..., sin(f_{L-1} p), cos(f_{L-1} p),   f_k = 2^k or pi 2^k,
// in this order, three values each: 6 L values, and 3 more with the identity.
//
// 2^k p is exact in binary, and for f_k = pi 2^k so is its reduction modulo 2, so the error is that of one
// sine at every k: below 1e-6 in float, where sin(x * float(pi 2^k)) has 1e-4 at k = 9 and 0.1 at k = 19.
#pragma once

#include <cmath>
#include <numbers>

namespace nerf {

struct EncodingOptions {
  int frequencies = 10;  // L; 0 with the identity: p itself, the ablation without encoding
  bool identity = true;  // whether p itself comes first
  bool times_pi = true;  // f_k = pi 2^k, for p in [-1, 1]; else 2^k, for p in scene units
};

inline int EncodedSize(const EncodingOptions& options) {
  return (options.identity ? 3 : 0) + 6 * options.frequencies;
}

// Writes EncodedSize(options) values.
template <typename Scalar>
void PositionalEncoding(const EncodingOptions& options, const Scalar p[3], Scalar* code) {
  if (options.identity) {
    for (int i = 0; i < 3; ++i) *code++ = p[i];
  }
  Scalar scaled[3] = {p[0], p[1], p[2]};
  for (int k = 0; k < options.frequencies; ++k, code += 6) {
    for (int i = 0; i < 3; ++i) {
      Scalar angle = scaled[i];
      if (options.times_pi) {
        angle = std::numbers::pi_v<Scalar> * (angle - Scalar(2) * std::nearbyint(angle / Scalar(2)));
      }
      code[i] = std::sin(angle);
      code[3 + i] = std::cos(angle);
      scaled[i] *= Scalar(2);
    }
  }
}

}  // namespace nerf
