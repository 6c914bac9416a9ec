// Include in tests that need the networks of LibTorch.
#pragma once

#include <gtest/gtest.h>

#include "nerf/fields/torch_mlp.h"

namespace tests {

class TorchEnvironment : public testing::Environment {
  void SetUp() override { nerf::UseTorch(); }
};
inline const auto* const kTorchEnvironment = testing::AddGlobalTestEnvironment(new TorchEnvironment);

}  // namespace tests
