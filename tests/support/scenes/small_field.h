// Support for tests: a `hash` field that has learned nothing.
#pragma once

#include <memory>

#include "nerf/fields/scene_field.h"

namespace tests {

inline nerf::SceneField SmallField() {
  return nerf::SceneField(
      nerf::SceneContraction{},
      nerf::SamplerOptions{},
      std::make_unique<nerf::HashField>(
          nerf::HashFieldOptions{
              .grid = {.log2_hashmap_size = 4, .base_resolution = 4, .finest_resolution = 16}},
          1),
      64);
}

}  // namespace tests
