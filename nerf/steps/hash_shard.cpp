#include "nerf/steps/hash_shard.h"

#include <cmath>
#include <cstring>

namespace nerf {
namespace {

// Rows that go through the networks together: their activations (about 1.4 KB a row in float) stay in a 1 MB
// second-level cache.
constexpr int kChunkRows = 512;
// Of the sample at infinity: no light passes it, e^-30 = 1e-13.
constexpr float kDepthAtInfinity = 30;
constexpr std::size_t kInputs = HashNetwork<float>::kInputs;

template <typename T>
void Grow(std::vector<T>* v, std::size_t size) {
  if (v->size() < size) v->resize(size);
}

// Fills shard->samples, and scratch->features with their features.
template <typename Real>
void MarchShard(const HashShardContext<Real>& context,
                HashShardScratch<Real>* scratch,
                HashShard<Real>* shard) {
  scratch->kept_features.clear();
  const auto query = [&](const Samples& wave, float* sigma) {
    Grow(&scratch->wave_features, static_cast<std::size_t>(wave.size()) * kInputs);
    context.grid.Encode(wave, 0, wave.size(), scratch->wave_features.data());
    context.network.QueryDensity(wave.size(), scratch->wave_features.data(), &scratch->rows, sigma);
  };
  const auto keep_features = [&](std::size_t i) {
    const Real* row = &scratch->wave_features[i * kInputs];
    scratch->kept_features.insert(scratch->kept_features.end(), row, row + kInputs);
  };
  MarchAll(
      context.sampler, context.plan, query, keep_features, &scratch->batch, &scratch->kept, &shard->samples);
  const std::vector<std::size_t>& place = scratch->kept.place;
  Grow(&scratch->features, place.size() * kInputs);
  for (std::size_t i = 0; i < place.size(); ++i) {
    std::memcpy(
        &scratch->features[place[i] * kInputs], &scratch->kept_features[i * kInputs], kInputs * sizeof(Real));
  }
}

// The networks' outputs for the samples of a chunk, in scratch->rows.
template <typename Real>
void QueryChunk(const HashShardContext<Real>& context,
                const ShardSamples& samples,
                const RayChunk& chunk,
                HashShardScratch<Real>* scratch) {
  NetworkRows<Real>& rows = scratch->rows;
  rows.Resize(static_cast<int>(chunk.n));
  std::memcpy(
      rows.features.data(), &scratch->features[chunk.first * kInputs], chunk.n * kInputs * sizeof(Real));
  context.network.QueryDensity(&rows);
  for (int r = chunk.ray_begin; r < chunk.ray_end; ++r) {
    const int begin = static_cast<int>(samples.First(r) - chunk.first),
              end = static_cast<int>(samples.First(r + 1) - chunk.first);
    context.network.SetDirection(
        scratch->batch.rays[static_cast<std::size_t>(r)].ray.direction, begin, end, &rows);
  }
  context.network.QueryColour(&rows);
}

// From gradients of colours and optical depths to those of the networks' outputs, logits and log sigma, in
// place: sigma = exp(log sigma) and rgb = sigmoid(logit). At infinity the density means nothing. Scales those
// of near samples, see BatchPlan.
template <typename Real>
void DifferentiateOutputs(const BatchPlan& plan,
                          const ShardSamples& samples,
                          const RayChunk& chunk,
                          HashShardScratch<Real>* scratch) {
  PixelGradients& pixels = scratch->pixels;
  float *logits = pixels.rgb_gradients.data(), *log_sigma = pixels.tau_gradients.data();
  const AlignedVector<float>& rgb = scratch->rows.rgb;
  for (std::size_t i = 0; i < chunk.n; ++i)
    log_sigma[i] = std::isinf(samples.sorted.t[chunk.first + i]) ? 0 : log_sigma[i] * pixels.tau[i];
  for (std::size_t i = 0; i < 3 * chunk.n; ++i) logits[i] *= rgb[i] * (1.f - rgb[i]);
  for (std::size_t i = 0; i < chunk.n; ++i) {
    const float share = samples.sorted.t[chunk.first + i] / plan.full_gradient_distance;
    if (!(share < 1)) continue;
    log_sigma[i] *= share * share;
    for (std::size_t j = 3 * i; j < 3 * i + 3; ++j) logits[j] *= share * share;
  }
}

// Optical depths of a chunk's samples.
template <typename Real>
void OpticalDepths(const ShardSamples& samples,
                   const RayChunk& chunk,
                   const NetworkRows<Real>& rows,
                   std::vector<float>* tau) {
  for (std::size_t i = 0; i < chunk.n; ++i) {
    const bool at_infinity = std::isinf(samples.sorted.t[chunk.first + i]);
    (*tau)[i] = at_infinity ? kDepthAtInfinity : rows.sigma[i] * samples.sorted.delta[chunk.first + i];
  }
}

// Copies the chunk's gradients of the features, in rows, to those of the shard, by level.
template <typename Real>
void StoreFeatureGradients(const RayChunk& chunk,
                           std::size_t n_levels,
                           const NetworkRows<Real>& rows,
                           HashShard<Real>* shard) {
  for (std::size_t l = 0; l < n_levels; ++l) {
    Real* target = shard->feature_gradients.data() + l * shard->feature_gradient_stride +
                   chunk.first * kernels::kFeatures;
    for (std::size_t i = 0; i < chunk.n; ++i) {
      std::memcpy(target + i * kernels::kFeatures,
                  &rows.features_gradient[i * kInputs + l * kernels::kFeatures],
                  kernels::kFeatures * sizeof(Real));
    }
  }
}

template <typename Real>
void DifferentiateChunk(const HashShardContext<Real>& context,
                        const RayChunk& chunk,
                        HashShardScratch<Real>* scratch,
                        HashShard<Real>* shard) {
  const kernels::Kernels& kernels = kernels::ActiveKernels();
  const int n = static_cast<int>(chunk.n);
  NetworkRows<Real>& rows = scratch->rows;
  PixelGradients& pixels = scratch->pixels;
  QueryChunk(context, shard->samples, chunk, scratch);
  pixels.resize(chunk.n);
  OpticalDepths(shard->samples, chunk, rows, &pixels.tau);
  pixels.weights = pixels.tau;
  kernels.one_minus_exp_neg(n, pixels.weights.data());
  const std::vector<BatchRay>& rays = scratch->batch.rays;
  CompositePixels(context.plan, rays, shard->samples, chunk, rows.rgb.data(), &pixels, &shard->loss);
  DifferentiateOutputs(context.plan, shard->samples, chunk, scratch);
  context.network.Backward(
      pixels.rgb_gradients.data(), pixels.tau_gradients.data(), &rows, shard->weight_gradients.data());
  if (!shard->loss.bad_ray &&
      !kernels.Network<Real>().all_finite(n * static_cast<int>(kInputs), rows.features_gradient.data()))
    shard->loss.bad_ray = rays[static_cast<std::size_t>(chunk.ray_begin)].id;
  StoreFeatureGradients(chunk, context.grid.levels().size(), rows, shard);
}

template <typename Real>
void DifferentiateCameras(const HashShardContext<Real>& context,
                          HashShardScratch<Real>* scratch,
                          HashShard<Real>* shard) {
  const Samples& samples = shard->samples.sorted;
  UnitGradients& unit = scratch->unit_gradients;
  for (std::vector<float>& axis : unit) axis.assign(static_cast<std::size_t>(samples.size()), 0.f);
  float* const gradients[3] = {unit[0].data(), unit[1].data(), unit[2].data()};
  for (std::size_t l = 0; l < context.grid.levels().size(); ++l) {
    const Real* feature_gradients = shard->feature_gradients.data() + l * shard->feature_gradient_stride;
    context.grid.PositionGradient(static_cast<int>(l), feature_gradients, samples, samples.size(), gradients);
  }
  context.refinement->Differentiate(scratch->batch, shard->samples, unit, &shard->camera_gradients);
}

}  // namespace

template <typename Real>
void RunHashShard(const HashShardContext<Real>& context,
                  int index,
                  HashShardScratch<Real>* scratch,
                  HashShard<Real>* shard) {
  shard->samples.clear();
  shard->loss = {};
  shard->weight_gradients.assign(context.network.n_weights(), 0.f);
  shard->camera_gradients.clear();
  DrawRays(context.dataset, context.sampler, context.plan, index, &scratch->batch);
  MarchShard(context, scratch, shard);
  shard->feature_gradient_stride = scratch->kept.place.size() * kernels::kFeatures;
  Grow(&shard->feature_gradients, shard->feature_gradient_stride * context.grid.levels().size());
  const int n_rays = static_cast<int>(scratch->batch.rays.size());
  for (RayChunk chunk = {}; chunk.ray_end < n_rays;) {
    chunk = NextChunk(shard->samples, context.plan, chunk.ray_end, kChunkRows);
    DifferentiateChunk(context, chunk, scratch, shard);
  }
  if (context.refinement && CameraRefinement::LooksAt(index, context.plan.step))
    DifferentiateCameras(context, scratch, shard);
}

template void RunHashShard(const HashShardContext<float>&, int, HashShardScratch<float>*, HashShard<float>*);
template void RunHashShard(const HashShardContext<kernels::Bf16>&,
                           int,
                           HashShardScratch<kernels::Bf16>*,
                           HashShard<kernels::Bf16>*);

}  // namespace nerf
