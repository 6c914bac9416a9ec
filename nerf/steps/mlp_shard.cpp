#include "nerf/steps/mlp_shard.h"

#include <cstring>

#include "io/process/interrupt.h"

namespace nerf {
namespace {

// The random numbers of importance samples must differ from those of the stratified ones in the same step.
constexpr std::uint64_t kImportanceStream = std::uint64_t{1} << 63;

void DrawDistances(const MlpShardContext& context, MlpShard* shard) {
  const SamplerOptions& range = context.sampler.options();
  shard->t.resize(shard->batch.rays.size());
  for (std::size_t r = 0; r < shard->t.size(); ++r) {
    io::Random random(context.plan.seed, io::Stream::kJitter, context.plan.step, shard->batch.rays[r].id);
    StratifiedDistances(range.near, range.far, context.field.quadrature().n_samples, &random, &shard->t[r]);
  }
}

// Adds distances where the first network saw weight on the rays of the chunk.
void AddImportanceDistances(const MlpShardContext& context, const RayChunk& chunk, MlpShard* shard) {
  const SamplerOptions& range = context.sampler.options();
  for (int r = chunk.ray_begin; r < chunk.ray_end; ++r) {
    const auto ray = static_cast<std::size_t>(r);
    const float* weights = shard->pixels.weights.data() + (shard->samples.First(r) - chunk.first);
    const std::vector<float> ray_weights(weights, weights + shard->t[ray].size());
    io::Random random(context.plan.seed,
                      io::Stream::kJitter,
                      context.plan.step + kImportanceStream,
                      shard->batch.rays[ray].id);
    AddImportanceSamples(
        range.near, range.far, ray_weights, context.field.quadrature().n_importance, &random, &shard->t[ray]);
  }
}

// Samples at the distances shard->t.
void PlaceSamples(const MlpShardContext& context, MlpShard* shard) {
  const SamplerOptions& range = context.sampler.options();
  ShardSamples& samples = shard->samples;
  samples.sorted.clear();
  samples.ray_first.assign(1, 0);
  for (std::size_t r = 0; r < shard->t.size(); ++r) {
    IntervalLengths(range.near, range.far, context.field.quadrature().open_end, shard->t[r], &shard->delta);
    context.sampler.Place(shard->batch.rays[r].ray, shard->t[r], shard->delta, &samples.sorted);
    samples.ray_first.push_back(samples.sorted.size());
  }
}

// The inputs of the network for the samples of a chunk.
void EncodeChunk(const MlpShardContext& context, const RayChunk& chunk, MlpShard* shard) {
  context.field.EncodePositions(shard->samples.sorted,
                                static_cast<int>(chunk.first),
                                static_cast<int>(chunk.n),
                                &shard->position_codes);
  const std::size_t stride = shard->ray_codes.size() / shard->batch.rays.size();
  shard->direction_codes.resize(chunk.n * stride);
  for (int r = chunk.ray_begin; r < chunk.ray_end; ++r) {
    for (std::size_t i = shard->samples.First(r); i < shard->samples.First(r + 1); ++i) {
      std::memcpy(&shard->direction_codes[(i - chunk.first) * stride],
                  &shard->ray_codes[static_cast<std::size_t>(r) * stride],
                  stride * sizeof(float));
    }
  }
}

// The Mlp::Loss of a chunk.
void CompositeChunk(const MlpShardContext& context,
                    const RayChunk& chunk,
                    const float* density,
                    const float* logits,
                    float* density_gradients,
                    float* logit_gradients,
                    MlpShard* shard) {
  const DensityActivation activation = context.field.options().density;
  const float* delta = shard->samples.sorted.delta.data() + chunk.first;
  PixelGradients& pixels = shard->pixels;
  std::vector<float>& rgb = shard->rgb;
  pixels.resize(chunk.n), rgb.resize(3 * chunk.n);
  for (std::size_t i = 0; i < chunk.n; ++i) pixels.tau[i] = Density(activation, density[i]) * delta[i];
  for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = Sigmoid(logits[i]);
  Opacities(static_cast<int>(chunk.n), pixels.tau.data(), pixels.weights.data());
  CompositePixels(context.plan, shard->batch.rays, shard->samples, chunk, rgb.data(), &pixels, &shard->loss);
  for (std::size_t i = 0; i < chunk.n; ++i)
    density_gradients[i] = pixels.tau_gradients[i] * delta[i] * DensityGradient(activation, density[i]);
  for (std::size_t i = 0; i < rgb.size(); ++i)
    logit_gradients[i] = pixels.rgb_gradients[i] * rgb[i] * (1.f - rgb[i]);
}

void DifferentiateChunk(const MlpShardContext& context, int pass, const RayChunk& chunk, MlpShard* shard) {
  if (chunk.n == 0) {  // rays through empty space still count in the loss
    CompositeChunk(context, chunk, nullptr, nullptr, nullptr, nullptr, shard);
    return;
  }
  EncodeChunk(context, chunk, shard);
  const auto loss =
      [&](const float* density, const float* logits, float* density_gradients, float* logit_gradients) {
        CompositeChunk(context, chunk, density, logits, density_gradients, logit_gradients, shard);
      };
  const std::size_t at = static_cast<std::size_t>(pass) * context.field.weights_per_network();
  context.field.network(pass).Differentiate(static_cast<int>(chunk.n),
                                            shard->position_codes.data(),
                                            shard->direction_codes.data(),
                                            loss,
                                            shard->gradients.data() + at);
}

// One pass over all rays; all but the last choose where the next one has its samples.
void DifferentiatePass(const MlpShardContext& context, int pass, MlpShard* shard) {
  const bool is_last = pass + 1 == context.field.n_networks();
  const int rows = context.field.network(pass).ChunkRows();
  const int n_rays = static_cast<int>(shard->batch.rays.size());
  shard->loss.squared_error = shard->loss.opacity = 0;
  for (RayChunk chunk = {}; chunk.ray_end < n_rays;) {
    io::ThrowIfInterrupted();  // all chunks of the report's settings take minutes
    chunk = NextChunk(shard->samples, context.plan, chunk.ray_end, rows);
    DifferentiateChunk(context, pass, chunk, shard);
    if (!is_last) AddImportanceDistances(context, chunk, shard);
  }
  shard->n_differentiated += static_cast<std::uint64_t>(shard->samples.sorted.size());
}

void EncodeRays(const MlpField& field, MlpShard* shard) {
  const auto stride = static_cast<std::size_t>(CodeStride(MlpOptionsOf(field.options()).direction_inputs));
  shard->ray_codes.resize(shard->batch.rays.size() * stride);
  for (std::size_t r = 0; r < shard->batch.rays.size(); ++r)
    field.EncodeDirection(shard->batch.rays[r].ray.direction, &shard->ray_codes[r * stride]);
}

}  // namespace

void RunMlpShard(const MlpShardContext& context, int index, MlpShard* shard) {
  shard->samples.clear();
  shard->loss = {};
  shard->n_differentiated = 0;
  shard->gradients.assign(context.field.n_parameters(), 0.f);
  DrawRays(context.dataset, context.sampler, context.plan, index, &shard->batch);
  EncodeRays(context.field, shard);
  if (context.field.quadrature().n_samples == 0) {
    const auto query = [&](const Samples& wave, float* sigma) { context.field.QueryDensity(wave, sigma); };
    const auto ignore = [](std::size_t) {};
    MarchAll(context.sampler, context.plan, query, ignore, &shard->batch, &shard->kept, &shard->samples);
    DifferentiatePass(context, 0, shard);
    return;
  }
  DrawDistances(context, shard);
  for (int pass = 0; pass < context.field.n_networks(); ++pass) {
    PlaceSamples(context, shard);
    DifferentiatePass(context, pass, shard);
  }
}

}  // namespace nerf
