#include "nerf/metrics/separable_filter.h"

#include <algorithm>

#include "io/base/check.h"

namespace nerf {
namespace {

// A block of fixed length keeps its sums in registers over all taps.
constexpr int kBlock = 8;

// out[x] = sum_i kernel[i] * rows[i][x] for x in [0, n).
void WeightedSum(const std::vector<double>& kernel,
                 const std::vector<const double*>& rows,
                 int n,
                 double* out) {
  int x = 0;
  for (; x + kBlock <= n; x += kBlock) {
    double sum[kBlock] = {};
    for (std::size_t i = 0; i < kernel.size(); ++i) {
      for (int b = 0; b < kBlock; ++b) sum[b] += kernel[i] * rows[i][x + b];
    }
    std::copy(sum, sum + kBlock, out + x);
  }
  for (; x < n; ++x) {
    out[x] = 0;
    for (std::size_t i = 0; i < kernel.size(); ++i) out[x] += kernel[i] * rows[i][x];
  }
}

}  // namespace

Plane Correlate(const Plane& in,
                const std::vector<double>& kernel_x,
                const std::vector<double>& kernel_y,
                Border border) {
  const int taps = static_cast<int>(kernel_x.size()), radius = taps / 2;
  PIPELINE_CHECK_EQ(taps % 2, 1);
  PIPELINE_CHECK_EQ(kernel_x.size(), kernel_y.size());
  const bool valid = border == Border::kValid;
  if (valid) PIPELINE_CHECK_LE(taps, std::min(in.width, in.height));
  const int width = valid ? in.width - 2 * radius : in.width;
  const int height = valid ? in.height - 2 * radius : in.height;
  const int left = valid ? 0 : radius;  // columns of padding on each side

  Plane across(width, in.height);
  std::vector<double> padded(static_cast<std::size_t>(in.width + 2 * left));
  std::vector<const double*> rows(kernel_x.size());
  for (int y = 0; y < in.height; ++y) {
    const double* row = in.Row(y);
    std::fill_n(padded.begin(), left, row[0]);
    std::copy(row, row + in.width, padded.begin() + left);
    std::fill_n(padded.end() - left, left, row[in.width - 1]);
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = padded.data() + i;
    WeightedSum(kernel_x, rows, width, across.Row(y));
  }
  Plane out(width, height);
  for (int y = 0; y < height; ++y) {
    for (int i = 0; i < taps; ++i)
      rows[static_cast<std::size_t>(i)] = across.Row(std::clamp(y + i - left, 0, in.height - 1));
    WeightedSum(kernel_y, rows, width, out.Row(y));
  }
  return out;
}

}  // namespace nerf
