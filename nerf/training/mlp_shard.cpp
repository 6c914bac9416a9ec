#include "nerf/training/mlp_shard.h"

#include <cmath>
#include <cstring>

namespace nerf {
namespace {

// The random numbers of importance samples must differ from those of the stratified ones in the same step.
constexpr std::uint64_t kImportanceStream = std::uint64_t{1} << 63;

// Rows of the chunk [first ray, last ray) of a shard and the pass they belong to.
struct Chunk {
  int ray_begin, ray_end, pass;
  const std::vector<int>& first;  // first sample of each ray
  int Begin() const { return first[static_cast<std::size_t>(ray_begin)]; }
  int Size() const { return first[static_cast<std::size_t>(ray_end)] - Begin(); }
};

// Samples of all rays that light reaches, sorted by ray.
void SamplePruned(const NerfShardContext& context,
                  const Sampler& sampler,
                  const BatchPlan& plan,
                  MlpShard* shard) {
  shard->kept.clear();
  shard->kept_ray.clear();
  while (NextWave(sampler, plan, &shard->batch)) {
    const Samples& wave = shard->batch.wave;
    shard->sigma.resize(static_cast<std::size_t>(wave.size()));
    context.field.QueryDensity(wave, shard->sigma.data());
    shard->visited_cell.insert(shard->visited_cell.end(), wave.cell.begin(), wave.cell.end());
    shard->visited_sigma.insert(shard->visited_sigma.end(), shard->sigma.begin(), shard->sigma.end());
    EndWave(plan, shard->sigma.data(), &shard->batch, [&](int ray, std::size_t i) {
      shard->kept.x.push_back(wave.x[i]);
      shard->kept.y.push_back(wave.y[i]);
      shard->kept.z.push_back(wave.z[i]);
      shard->kept.delta.push_back(wave.delta[i]);
      shard->kept_ray.push_back(ray);
    });
  }
  shard->n_marched = shard->visited_cell.size();
  std::vector<int> next = FirstSamples(shard->batch);
  const std::size_t n = shard->kept_ray.size();
  Samples& out = shard->samples;
  out.x.resize(n), out.y.resize(n), out.z.resize(n), out.delta.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto to = static_cast<std::size_t>(next[static_cast<std::size_t>(shard->kept_ray[i])]++);
    out.x[to] = shard->kept.x[i], out.y[to] = shard->kept.y[i], out.z[to] = shard->kept.z[i];
    out.delta[to] = shard->kept.delta[i];
  }
}

void SampleStratified(const NerfShardContext& context, const BatchPlan& plan, MlpShard* shard) {
  const SamplerOptions& range = context.scene_field.sampler_options;
  shard->t.resize(shard->batch.rays.size());
  for (std::size_t r = 0; r < shard->t.size(); ++r) {
    io::Random random(plan.seed, io::Stream::kJitter, plan.step, shard->batch.rays[r].id);
    StratifiedDistances(range.near, range.far, context.field.quadrature().n_samples, &random, &shard->t[r]);
  }
}

// Samples at the distances shard->t; returns the first sample of each ray.
std::vector<int> Place(const NerfShardContext& context, const Sampler& sampler, MlpShard* shard) {
  const SamplerOptions& range = context.scene_field.sampler_options;
  shard->samples.clear();
  std::vector<int> first = {0};
  for (std::size_t r = 0; r < shard->t.size(); ++r) {
    IntervalLengths(range.near, range.far, context.field.quadrature().open_end, shard->t[r], &shard->delta);
    sampler.Place(shard->batch.rays[r].ray, shard->t[r], shard->delta, &shard->samples);
    first.push_back(shard->samples.size());
  }
  return first;
}

void Composite(const NerfShardContext& context,
               const BatchPlan& plan,
               const Chunk& chunk,
               const float* density,
               const float* logits,
               float* density_gradients,
               float* logit_gradients,
               MlpShard* shard) {
  const DensityActivation activation = context.field.options().density;
  const float* delta = shard->samples.delta.data() + chunk.Begin();
  for (std::size_t i = 0; i < shard->tau.size(); ++i)
    shard->tau[i] = Density(activation, density[i]) * delta[i];
  for (std::size_t i = 0; i < shard->rgb.size(); ++i) shard->rgb[i] = Sigmoid(logits[i]);
  const bool last_pass = chunk.pass + 1 == context.field.n_networks();
  const SamplerOptions& range = context.scene_field.sampler_options;
  for (int r = chunk.ray_begin; r < chunk.ray_end; ++r) {
    const auto index = static_cast<std::size_t>(r);
    const BatchRay& ray = shard->batch.rays[index];
    const int n = chunk.first[index + 1] - chunk.first[index];
    const auto begin = static_cast<std::size_t>(chunk.first[index] - chunk.Begin());
    float* weights = shard->weights.data() + begin;
    const float end = Transmittance(n, shard->tau.data() + begin, weights);
    for (int i = 0; i < n; ++i) weights[i] *= -std::expm1(-shard->tau[begin + static_cast<std::size_t>(i)]);
    float colour[3];
    CompositeColour(n, weights, shard->rgb.data() + 3 * begin, colour);
    const PixelLoss<float> pixel = LossOf(colour, end, ray.target);
    CompositeGradients(n,
                       weights,
                       shard->rgb.data() + 3 * begin,
                       end,
                       pixel,
                       1.f / static_cast<float>(plan.n_rays),
                       shard->rgb_gradients.data() + 3 * begin,
                       shard->tau_gradients.data() + begin);
    if (!std::isfinite(pixel.loss) && shard->fault.empty())
      shard->fault = "loss of ray " + std::to_string(ray.id);
    shard->loss += pixel.loss;
    if (last_pass) {
      shard->squared_error += pixel.squared_error;
      shard->opacity += 1.f - end;
    } else {
      io::Random random(plan.seed, io::Stream::kJitter, plan.step + kImportanceStream, ray.id);
      const std::vector<float> ray_weights(weights, weights + n);
      AddImportanceSamples(range.near,
                           range.far,
                           ray_weights,
                           context.field.quadrature().n_importance,
                           &random,
                           &shard->t[index]);
    }
  }
  for (std::size_t i = 0; i < shard->tau.size(); ++i)
    density_gradients[i] = shard->tau_gradients[i] * delta[i] * DensityGradient(activation, density[i]);
  for (std::size_t i = 0; i < shard->rgb.size(); ++i)
    logit_gradients[i] = shard->rgb_gradients[i] * shard->rgb[i] * (1.f - shard->rgb[i]);
}

void DifferentiateChunk(const NerfShardContext& context,
                        const BatchPlan& plan,
                        const Chunk& chunk,
                        MlpShard* shard) {
  const auto n = static_cast<std::size_t>(chunk.Size());
  shard->n_differentiated += n;
  context.field.EncodePositions(shard->samples, chunk.Begin(), chunk.Size(), &shard->position_codes);
  const std::size_t stride = shard->ray_codes.size() / shard->batch.rays.size();
  shard->direction_codes.resize(n * stride);
  for (int r = chunk.ray_begin; r < chunk.ray_end; ++r) {
    const auto ray = static_cast<std::size_t>(r);
    for (int i = chunk.first[ray] - chunk.Begin(); i < chunk.first[ray + 1] - chunk.Begin(); ++i) {
      std::memcpy(&shard->direction_codes[static_cast<std::size_t>(i) * stride],
                  &shard->ray_codes[ray * stride],
                  stride * sizeof(float));
    }
  }
  shard->tau.resize(n), shard->weights.resize(n), shard->tau_gradients.resize(n);
  shard->rgb.resize(3 * n), shard->rgb_gradients.resize(3 * n);
  const auto loss =
      [&](const float* density, const float* logits, float* density_gradients, float* logit_gradients) {
        Composite(context, plan, chunk, density, logits, density_gradients, logit_gradients, shard);
      };
  if (n == 0) {  // rays through empty space still count in the loss
    Composite(context, plan, chunk, nullptr, nullptr, nullptr, nullptr, shard);
    return;
  }
  const std::size_t at = static_cast<std::size_t>(chunk.pass) * context.field.weights_per_network();
  context.field.network(chunk.pass)
      .Differentiate(chunk.Size(),
                     shard->position_codes.data(),
                     shard->direction_codes.data(),
                     loss,
                     shard->gradients.data() + at);
}

void DifferentiateAll(const NerfShardContext& context,
                      const BatchPlan& plan,
                      int pass,
                      const std::vector<int>& first,
                      MlpShard* shard) {
  const int n_rays = static_cast<int>(shard->batch.rays.size());
  const int rows = context.field.network(pass).ChunkRows();
  for (int begin = 0; begin < n_rays;) {
    int end = begin + 1;
    const auto first_of = [&](int r) { return first[static_cast<std::size_t>(r)]; };
    while (end < n_rays && first_of(end + 1) - first_of(begin) <= rows) ++end;
    DifferentiateChunk(context, plan, {begin, end, pass, first}, shard);
    begin = end;
  }
}

}  // namespace

void RunNerfShard(const NerfShardContext& context, const BatchPlan& plan, int index, MlpShard* shard) {
  shard->loss = shard->squared_error = shard->opacity = 0;
  shard->n_marched = shard->n_differentiated = 0;
  shard->fault.clear();
  shard->gradients.assign(context.field.n_parameters(), 0.f);
  shard->visited_cell.clear();
  shard->visited_sigma.clear();
  const Sampler sampler(
      context.scene_field.sampler_options, context.scene_field.map, context.scene_field.grid);
  DrawRays(context.dataset, sampler, plan, index, &shard->batch);
  const auto stride =
      static_cast<std::size_t>(CodeStride(MlpOptionsOf(context.field.options()).direction_inputs));
  shard->ray_codes.resize(shard->batch.rays.size() * stride);
  for (std::size_t r = 0; r < shard->batch.rays.size(); ++r)
    context.field.EncodeDirection(shard->batch.rays[r].ray.direction, &shard->ray_codes[r * stride]);

  if (context.field.quadrature().n_samples == 0) {
    SamplePruned(context, sampler, plan, shard);
    DifferentiateAll(context, plan, 0, FirstSamples(shard->batch), shard);
    return;
  }
  SampleStratified(context, plan, shard);
  for (int pass = 0; pass < context.field.n_networks(); ++pass) {
    const std::vector<int> first = Place(context, sampler, shard);
    DifferentiateAll(context, plan, pass, first, shard);
  }
}

}  // namespace nerf
