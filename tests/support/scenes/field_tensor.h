// Values of a field by the name of their tensor.
#pragma once

#include <gtest/gtest.h>

#include <span>
#include <string>

#include "nerf/fields/radiance_field.h"

namespace tests {

// After a change, call field->Refresh().
inline std::span<float> TensorOf(nerf::RadianceField* field, const std::string& name) {
  for (const nerf::Tensor& tensor : field->State()) {
    if (tensor.name == name) return tensor.values;
  }
  ADD_FAILURE() << "no tensor " << name;
  return {};
}

}  // namespace tests
