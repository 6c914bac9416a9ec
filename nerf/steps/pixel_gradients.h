// Compositing of a chunk of rays in training: from opacities and colours of samples to the losses of pixels
// and their gradients. Equations: volume_rendering.h, distortion.h and depth_loss.h.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "nerf/steps/shard_samples.h"

namespace nerf {

struct ShardLoss {
  double loss = 0, squared_error = 0, opacity = 0;  // sums over pixels
  std::optional<std::uint64_t> bad_ray;             // the first whose loss or gradient is not finite
};

// Rows of a chunk, one per sample, and scratch. Reused from chunk to chunk.
struct PixelGradients {
  std::vector<float> tau;             // optical depths
  std::vector<float> weights;         // opacities at first; compositing makes weights of them
  std::vector<float> rgb_gradients;   // [n][3]: d loss / d colour
  std::vector<float> tau_gradients;   // d loss / d optical depth
  std::vector<float> transmittances;  // behind each ray of a pixel
  // Of one ray, see distortion.h.
  std::vector<float> places, lengths, weight_gradients;

  void resize(std::size_t n) {
    tau.resize(n), weights.resize(n), tau_gradients.resize(n), rgb_gradients.resize(3 * n);
  }
};

// Composites the rays of `chunk` from rows->tau, rows->weights and rgb [n][3]. A pixel is the mean of its
// rays. Adds the losses of the pixels, distortion and depth included, to `loss`, and fills the gradients of
// the mean over all pixels of the batch.
void CompositePixels(const BatchPlan& plan,
                     const std::vector<BatchRay>& rays,
                     const ShardSamples& samples,
                     const RayChunk& chunk,
                     const float* rgb,
                     PixelGradients* rows,
                     ShardLoss* loss);

}  // namespace nerf
