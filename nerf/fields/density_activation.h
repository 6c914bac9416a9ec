// From the network's unbounded output to a density per scene unit, and the derivative.
//
//   softplus: sigma = log(1 + e^(x - 1)) [Barron et al. 2021], whose gradient is never 0
//   relu:     sigma = max(x, 0) [Mildenhall et al. 2020]; for x <= 0 the gradient is 0, so a field that
//   starts
//             there stays there
//   exp:      sigma = e^(x - 1) up to e^15, with gradient 0 beyond [Mueller et al. 2022]; learns sharp edges
//             fastest
#pragma once

#include <cmath>

namespace nerf {

enum class DensityActivation { kSoftplus, kRelu, kExp };

// The shift makes a new network a thin fog of 0.31 (softplus) or 0.37 (exp) per unit.
inline constexpr double kDensityShift = 1.0;
// Beyond e^15 per unit everything is opaque within any interval.
inline constexpr double kMaxLogDensity = 15.0;

// Finite and monotone for every finite x; NaN stays NaN.
template <typename Scalar>
Scalar Density(DensityActivation activation, Scalar x) {
  if (activation == DensityActivation::kRelu) return x <= Scalar(0) ? Scalar(0) : x;
  const Scalar y = x - Scalar(kDensityShift);
  if (activation == DensityActivation::kExp)
    return std::exp(y > Scalar(kMaxLogDensity) ? Scalar(kMaxLogDensity) : y);
  return (y > Scalar(0) ? y : Scalar(0)) + std::log1p(std::exp(-std::fabs(y)));
}

// d sigma / d x.
template <typename Scalar>
Scalar DensityGradient(DensityActivation activation, Scalar x) {
  if (activation == DensityActivation::kRelu)
    return x > Scalar(0) ? Scalar(1) : x <= Scalar(0) ? Scalar(0) : x;
  const Scalar y = x - Scalar(kDensityShift);
  if (activation == DensityActivation::kExp) return y > Scalar(kMaxLogDensity) ? Scalar(0) : std::exp(y);
  const Scalar e = std::exp(-std::fabs(y));
  return (y >= Scalar(0) ? Scalar(1) : e) / (Scalar(1) + e);
}

template <typename Scalar>
Scalar Sigmoid(Scalar x) {
  const Scalar e = std::exp(-std::fabs(x));
  return (x >= Scalar(0) ? Scalar(1) : e) / (Scalar(1) + e);
}

}  // namespace nerf
