// What the payload stores of a field.
#include <gtest/gtest.h>

#include <cmath>

#include "io/base/random.h"
#include "pipeline/page/field_payload.h"

namespace pipeline {
namespace {

TEST(FieldPayload, KeepsTheDigitsOfSmallFeatures) {
  std::vector<float> features;
  for (std::uint64_t i = 0; i < 4000; ++i)
    features.push_back(std::pow(2.f * io::Random(1, io::Stream::kInit, 0, i).Uniform() - 1.f, 3.f));
  const QuantizedLevel level = QuantizeLevel(features);
  ASSERT_EQ(level.texels.size(), features.size());
  for (std::size_t i = 0; i < features.size(); ++i) {
    const float scale = level.scale[i % 4], share = std::fabs(features[i]) / scale;
    // Half a step of 1/127 in the root r moves r^2 by r / 127.
    EXPECT_NEAR(Dequantize(level.texels[i], scale), features[i], scale * (std::sqrt(share) / 127 + 2e-5f));
  }
}

TEST(FieldPayload, KeepsZeroAndTheExtremes) {
  const QuantizedLevel level = QuantizeLevel(std::vector<float>{0, -3, 0, 2, 0, 3, 0, -2});
  const std::vector<float> scales(level.scale.begin(), level.scale.end());
  EXPECT_EQ(scales, (std::vector<float>{0, 3, 0, 2}));
  for (const std::size_t i : {0u, 2u, 4u, 6u}) EXPECT_EQ(Dequantize(level.texels[i], level.scale[i % 4]), 0);
  EXPECT_FLOAT_EQ(Dequantize(level.texels[1], 3), -3);
  EXPECT_FLOAT_EQ(Dequantize(level.texels[5], 3), 3);
}

}  // namespace
}  // namespace pipeline
