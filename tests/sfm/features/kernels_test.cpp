// Every build of the descriptor kernel against the plain twin, to the bit.
#include "sfm/features/kernels/kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <stdexcept>

namespace {

using sfm::kernels::kDimensions;
using sfm::kernels::Neighbour;

// n descriptors of length 512; many equal ones, so that ties occur.
std::vector<std::uint8_t> RootSiftLike(int n, std::mt19937* random) {
  std::vector<std::uint8_t> rows;
  for (int i = 0; i < n; ++i) {
    if (i >= 4 && (*random)() % 5 == 0) {
      const auto row =
          rows.begin() + static_cast<std::ptrdiff_t>((*random)() % static_cast<unsigned>(i)) * kDimensions;
      const std::vector<std::uint8_t> copy(row, row + kDimensions);
      rows.insert(rows.end(), copy.begin(), copy.end());
      continue;
    }
    double values[kDimensions], sum = 0;
    for (double& value : values) sum += value = std::pow((*random)() % 1000, 2);
    for (const double value : values) {
      rows.push_back(static_cast<std::uint8_t>(std::min(255.0, std::round(512 * std::sqrt(value / sum)))));
    }
  }
  return rows;
}

void ExpectEqualToReference(const sfm::kernels::Kernel& kernel,
                            const std::vector<std::uint8_t>& a,
                            const std::vector<std::uint8_t>& b) {
  const std::size_t rows_a = a.size() / kDimensions, rows_b = b.size() / kDimensions;
  std::vector<Neighbour> from_a(rows_a), from_b(rows_b), expected_a(rows_a), expected_b(rows_b);
  const int n_a = static_cast<int>(rows_a), n_b = static_cast<int>(rows_b);
  kernel.nearest(kernel.prepare(a.data(), n_a), kernel.prepare(b.data(), n_b), from_a.data(), from_b.data());
  sfm::kernels::NearestReference(a.data(), n_a, b.data(), n_b, expected_a.data(), expected_b.data());
  EXPECT_TRUE(from_a == expected_a) << kernel.name << " " << n_a << " x " << n_b;
  EXPECT_TRUE(from_b == expected_b) << kernel.name << " " << n_a << " x " << n_b;
}

class Kernels : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    kernel_ = sfm::kernels::FindKernel(GetParam());
    if (!kernel_) GTEST_SKIP() << "this CPU has no " << GetParam();
  }
  const sfm::kernels::Kernel* kernel_ = nullptr;
  std::mt19937 random_{7};
};

TEST_P(Kernels, EveryTailOfEverySize) {
  int cases = 0;
  // 2048 rows are one tile, 6 rows and 64 columns one micro-tile and panel.
  for (const int n_a : {0, 1, 2, 5, 6, 7, 12, 63, 64, 65, 300}) {
    for (const int n_b : {0, 1, 2, 15, 16, 17, 31, 33, 63, 64, 65, 129}) {
      ExpectEqualToReference(*kernel_, RootSiftLike(n_a, &random_), RootSiftLike(n_b, &random_));
      ++cases;
    }
  }
  EXPECT_EQ(cases, 11 * 12);
}

TEST_P(Kernels, MoreRowsThanATile) {
  for (const int n_a : {2045, 2046, 2047, 4100}) {
    ExpectEqualToReference(*kernel_, RootSiftLike(n_a, &random_), RootSiftLike(70, &random_));
    ExpectEqualToReference(*kernel_, RootSiftLike(70, &random_), RootSiftLike(n_a, &random_));
  }
}

TEST_P(Kernels, ExtremeBytes) {
  // Single dimensions of 255 and all of 63: the largest products, and norms just below the limit.
  std::vector<std::uint8_t> a(40 * kDimensions), b(40 * kDimensions);
  for (std::size_t i = 0; i < 40; ++i) {
    a[i * kDimensions + i] = 255;
    for (std::size_t k = 0; k < kDimensions; ++k)
      b[i * kDimensions + k] = static_cast<std::uint8_t>(i % 2 ? 63 : 0);
    b[i * kDimensions + i] = static_cast<std::uint8_t>(i % 3 ? 255 : 63);
  }
  b[0] = 255;
  EXPECT_LT(127 * 63 * 63 + 255 * 255, sfm::kernels::kMaxSquaredNorm + 60000);
  for (std::size_t i = 0; i < 40; ++i) {
    if (i % 2) std::fill_n(&b[i * kDimensions + 100], 20, std::uint8_t{0});
  }
  ExpectEqualToReference(*kernel_, a, b);
  ExpectEqualToReference(*kernel_, b, a);
}

TEST_P(Kernels, LimitsAreChecked) {
  std::vector<std::uint8_t> rows(kDimensions, 64);  // 128 * 64^2 = 2^19
  EXPECT_THROW(kernel_->prepare(rows.data(), 1), std::invalid_argument);
  rows.assign(static_cast<std::size_t>(sfm::kernels::kMaxDescriptors + 1) * kDimensions, 0);
  EXPECT_THROW(kernel_->prepare(rows.data(), sfm::kernels::kMaxDescriptors + 1), std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(Builds, Kernels, testing::Values("portable", "avx2", "avx512"));

}  // namespace
