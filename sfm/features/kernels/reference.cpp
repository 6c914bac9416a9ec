// What the kernels compute, in plain loops.
#include "sfm/features/kernels/kernels.h"

namespace sfm::kernels {
namespace {

void Offer(std::int32_t distance, std::int32_t index, Neighbour* nearest) {
  if (distance < nearest->distance || nearest->index < 0) {
    nearest->second = nearest->index < 0 ? nearest->second : nearest->distance;
    nearest->distance = distance;
    nearest->index = index;
  } else if (distance < nearest->second) {
    nearest->second = distance;
  }
}

}  // namespace

void NearestReference(
    const std::uint8_t* a, int n_a, const std::uint8_t* b, int n_b, Neighbour* from_a, Neighbour* from_b) {
  for (int i = 0; i < n_a; ++i) from_a[i] = {};
  for (int j = 0; j < n_b; ++j) from_b[j] = {};
  for (int i = 0; i < n_a; ++i) {
    for (int j = 0; j < n_b; ++j) {
      std::int32_t distance = 0;
      for (int k = 0; k < kDimensions; ++k) {
        const std::int32_t difference =
            static_cast<std::int32_t>(a[i * kDimensions + k]) - b[j * kDimensions + k];
        distance += difference * difference;
      }
      Offer(distance, j, &from_a[i]);
      Offer(distance, i, &from_b[j]);
    }
  }
}

}  // namespace sfm::kernels
