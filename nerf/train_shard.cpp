#include "nerf/train_shard.h"

#include <cmath>
#include <cstring>

namespace nerf {
namespace {

// Rows that go through the networks together: their activations (about 1.2 KB a row) stay in a 1 MB
// second-level cache.
constexpr int kChunkRows = 512;
template <typename T>
void Grow(std::vector<T>* v, std::size_t size) {
  if (v->size() < size) v->resize(size);
}

// Queries the densities of the current wave and keeps what light reaches.
void QueryWave(const HashField& field, const BatchPlan& plan, ShardScratch* scratch, ShardResult* result) {
  RayBatch& batch = scratch->batch;
  const Samples& wave = batch.wave;
  const int n = wave.size();
  FieldRows& rows = scratch->rows;
  rows.Resize(n);
  field.Encode(wave, 0, n, rows.features.data());
  field.QueryDensity(rows.features.data(), &rows);
  result->visited_cell.insert(result->visited_cell.end(), wave.cell.begin(), wave.cell.end());
  result->visited_sigma.insert(result->visited_sigma.end(), rows.sigma.begin(), rows.sigma.begin() + n);
  EndWave(plan, rows.sigma.data(), &batch, [&](int ray, std::size_t i) {
    scratch->kept.x.push_back(wave.x[i]);
    scratch->kept.y.push_back(wave.y[i]);
    scratch->kept.z.push_back(wave.z[i]);
    scratch->kept.delta.push_back(wave.delta[i]);
    scratch->kept_ray.push_back(ray);
    const float* row = &rows.features[i * HashField::kInputs];
    scratch->kept_features.insert(scratch->kept_features.end(), row, row + HashField::kInputs);
  });
}

// Brings the kept samples into ray order. ray_first[r] is the first sample of ray r.
void SortByRay(ShardScratch* scratch, ShardResult* result, std::vector<int>* ray_first) {
  const std::size_t n = scratch->kept_ray.size();
  *ray_first = FirstSamples(scratch->batch);
  std::vector<int> next(ray_first->begin(), ray_first->end() - 1);
  Samples& samples = result->samples;
  samples.x.resize(n), samples.y.resize(n), samples.z.resize(n);
  Grow(&scratch->delta, n), Grow(&scratch->features, n * HashField::kInputs);
  for (std::size_t i = 0; i < n; ++i) {
    const auto to = static_cast<std::size_t>(next[static_cast<std::size_t>(scratch->kept_ray[i])]++);
    samples.x[to] = scratch->kept.x[i];
    samples.y[to] = scratch->kept.y[i];
    samples.z[to] = scratch->kept.z[i];
    scratch->delta[to] = scratch->kept.delta[i];
    std::memcpy(&scratch->features[to * HashField::kInputs],
                &scratch->kept_features[i * HashField::kInputs],
                HashField::kInputs * sizeof(float));
  }
}

// Loss and gradients of the rays [ray_begin, ray_end), whose samples are the rows from `first` on.
void DifferentiateRays(const HashField& field,
                       const BatchPlan& plan,
                       int ray_begin,
                       int ray_end,
                       const std::vector<int>& ray_first,
                       ShardScratch* scratch,
                       ShardResult* result) {
  const kernels::Kernels& kernels = kernels::ActiveKernels();
  const auto first = static_cast<std::size_t>(ray_first[static_cast<std::size_t>(ray_begin)]);
  const auto n = static_cast<std::size_t>(ray_first[static_cast<std::size_t>(ray_end)]) - first;
  FieldRows& rows = scratch->rows;
  rows.Resize(static_cast<int>(n));
  std::memcpy(rows.features.data(),
              &scratch->features[first * HashField::kInputs],
              n * HashField::kInputs * sizeof(float));
  field.QueryDensity(rows.features.data(), &rows);
  Grow(&scratch->tau, n), Grow(&scratch->weights, n), Grow(&scratch->logit_gradients, 3 * n),
      Grow(&scratch->log_sigma_gradients, n);
  for (std::size_t i = 0; i < n; ++i)
    scratch->tau[i] = scratch->weights[i] = rows.sigma[i] * scratch->delta[first + i];
  kernels.one_minus_exp_neg(static_cast<int>(n), scratch->weights.data());
  for (int r = ray_begin; r < ray_end; ++r) {
    float harmonics[kHarmonics];
    SphericalHarmonics(scratch->batch.rays[static_cast<std::size_t>(r)].ray.direction, harmonics);
    for (auto i = static_cast<std::size_t>(ray_first[static_cast<std::size_t>(r)]) - first;
         i < static_cast<std::size_t>(ray_first[static_cast<std::size_t>(r) + 1]) - first;
         ++i) {
      std::memcpy(&rows.colour_in[i * HashField::kInputs + HashField::kOutputs], harmonics, sizeof harmonics);
    }
  }
  field.QueryColour(&rows);

  for (int r = ray_begin; r < ray_end; ++r) {
    const BatchRay& ray = scratch->batch.rays[static_cast<std::size_t>(r)];
    const std::size_t begin = static_cast<std::size_t>(ray_first[static_cast<std::size_t>(r)]) - first;
    float depth = 0, transmittance = 1;
    for (std::size_t i = begin; i < begin + static_cast<std::size_t>(ray.n_kept); ++i) {
      scratch->weights[i] *= transmittance;
      depth += scratch->tau[i];
      transmittance = std::exp(-depth);
    }
    float colour[3];
    const float* rgb = rows.rgb.data() + 3 * begin;
    CompositeColour(ray.n_kept, scratch->weights.data() + begin, rgb, colour);
    const PixelLoss<float> pixel = RandomBackgroundLoss(colour, transmittance, ray.target);
    float* logit_gradients = scratch->logit_gradients.data() + 3 * begin;
    float* log_sigma_gradients = scratch->log_sigma_gradients.data() + begin;
    CompositeGradients(ray.n_kept,
                       scratch->weights.data() + begin,
                       rgb,
                       transmittance,
                       pixel,
                       1.f / static_cast<float>(plan.n_rays),
                       logit_gradients,
                       log_sigma_gradients);
    // sigma = exp(logit) and rgb = sigmoid(logit).
    for (int i = 0; i < ray.n_kept; ++i)
      log_sigma_gradients[i] *= scratch->tau[begin + static_cast<std::size_t>(i)];
    for (int i = 0; i < 3 * ray.n_kept; ++i) logit_gradients[i] *= rgb[i] * (1.f - rgb[i]);
    if (!std::isfinite(pixel.loss) && result->finite) {
      result->finite = false;
      result->first_bad_ray = ray.id;
    }
    result->loss += pixel.loss;
    result->squared_error += pixel.squared_error;
    result->opacity += 1.f - transmittance;
  }
  field.Backward(scratch->logit_gradients.data(),
                 scratch->log_sigma_gradients.data(),
                 &rows,
                 result->weight_gradients.data());
}

// 0 * x is 0 for every finite x and NaN otherwise.
bool AllFinite(const float* values, std::size_t n) {
  float sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += values[i] * 0.f;
  return sum == 0.f;
}

}  // namespace

void TrainShard(const Dataset& dataset,
                const HashField& field,
                const Sampler& sampler,
                const BatchPlan& plan,
                int shard,
                ShardScratch* scratch,
                ShardResult* result) {
  result->visited_cell.clear();
  result->visited_sigma.clear();
  result->weight_gradients.assign(field.n_weights(), 0.f);
  result->loss = result->squared_error = result->opacity = 0;
  result->finite = true;
  scratch->kept.clear();
  scratch->kept_ray.clear();
  scratch->kept_features.clear();

  DrawRays(dataset, sampler, plan, shard, &scratch->batch);
  while (NextWave(sampler, plan, &scratch->batch)) QueryWave(field, plan, scratch, result);
  std::vector<int> ray_first;
  SortByRay(scratch, result, &ray_first);

  const auto n_levels = field.levels().size();
  const std::size_t stride = scratch->kept_ray.size() * kernels::kFeatures;
  result->feature_gradient_stride = stride;
  Grow(&result->feature_gradients, stride * n_levels);
  const int n_rays = static_cast<int>(scratch->batch.rays.size());
  for (int ray_begin = 0; ray_begin < n_rays;) {
    int ray_end = ray_begin + 1;
    const auto first_of = [&](int r) { return ray_first[static_cast<std::size_t>(r)]; };
    while (ray_end < n_rays && first_of(ray_end + 1) - first_of(ray_begin) <= kChunkRows) ++ray_end;
    DifferentiateRays(field, plan, ray_begin, ray_end, ray_first, scratch, result);

    const FieldRows& rows = scratch->rows;
    const auto n = static_cast<std::size_t>(rows.n), first = static_cast<std::size_t>(first_of(ray_begin));
    if (!AllFinite(rows.features_gradient.data(), n * HashField::kInputs) && result->finite) {
      result->finite = false;
      result->first_bad_ray = scratch->batch.rays[static_cast<std::size_t>(ray_begin)].id;
    }
    for (std::size_t l = 0; l < n_levels; ++l) {
      float* target = result->feature_gradients.data() + l * stride + first * kernels::kFeatures;
      for (std::size_t i = 0; i < n; ++i) {
        std::memcpy(target + i * kernels::kFeatures,
                    &rows.features_gradient[i * HashField::kInputs + l * kernels::kFeatures],
                    kernels::kFeatures * sizeof(float));
      }
    }
    ray_begin = ray_end;
  }
}

}  // namespace nerf
