// Real spherical harmonics up to degree 3 (16 values) of a unit direction, the view-direction encoding of
// instant-ngp ("degree 4" in its counting). Constants: Sloan 2008, appendix A2, Condon-Shortley sign.
#pragma once

namespace nerf {

inline constexpr int kHarmonics = 16;

template <typename Scalar>
void SphericalHarmonics(const Scalar d[3], Scalar out[kHarmonics]) {
  const Scalar x = d[0], y = d[1], z = d[2];
  const Scalar xx = x * x, yy = y * y, zz = z * z;
  out[0] = Scalar(0.28209479177387814);
  out[1] = Scalar(-0.48860251190291987) * y;
  out[2] = Scalar(0.48860251190291987) * z;
  out[3] = Scalar(-0.48860251190291987) * x;
  out[4] = Scalar(1.0925484305920792) * x * y;
  out[5] = Scalar(-1.0925484305920792) * y * z;
  out[6] = Scalar(0.31539156525252005) * (Scalar(3) * zz - Scalar(1));
  out[7] = Scalar(-1.0925484305920792) * x * z;
  out[8] = Scalar(0.54627421529603959) * (xx - yy);
  out[9] = Scalar(-0.59004358992664352) * y * (Scalar(3) * xx - yy);
  out[10] = Scalar(2.8906114426405538) * x * y * z;
  out[11] = Scalar(-0.45704579946446572) * y * (Scalar(5) * zz - Scalar(1));
  out[12] = Scalar(0.3731763325901154) * z * (Scalar(5) * zz - Scalar(3));
  out[13] = Scalar(-0.45704579946446572) * x * (Scalar(5) * zz - Scalar(1));
  out[14] = Scalar(1.445305721320277) * z * (xx - yy);
  out[15] = Scalar(-0.59004358992664352) * x * (xx - Scalar(3) * yy);
}

}  // namespace nerf
