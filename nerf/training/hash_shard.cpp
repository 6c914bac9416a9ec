#include "nerf/training/hash_shard.h"

#include <cmath>
#include <cstring>

#include "nerf/rendering/distortion.h"

namespace nerf {
namespace {

// Rows that go through the networks together: their activations (about 1.4 KB a row in float) stay in a 1 MB
// second-level cache.
constexpr int kChunkRows = 512;
constexpr std::size_t kInputs = HashNetwork<float>::kInputs;

template <typename T>
void Grow(std::vector<T>* v, std::size_t size) {
  if (v->size() < size) v->resize(size);
}

// Queries the densities of the current wave and keeps what counts.
template <typename Real>
void QueryWave(const HashGrid& grid,
               const HashNetwork<Real>& network,
               const BatchPlan& plan,
               ShardScratch<Real>* scratch,
               ShardResult<Real>* result) {
  RayBatch& batch = scratch->batch;
  const Samples& wave = batch.wave;
  const auto n = static_cast<std::size_t>(wave.size());
  Grow(&scratch->wave_features, n * kInputs), Grow(&scratch->wave_sigma, n);
  grid.Encode(wave, 0, wave.size(), scratch->wave_features.data());
  network.QueryDensity(
      wave.size(), scratch->wave_features.data(), &scratch->rows, scratch->wave_sigma.data());
  const float* sigma = scratch->wave_sigma.data();
  result->visited_cell.insert(result->visited_cell.end(), wave.cell.begin(), wave.cell.end());
  result->visited_sigma.insert(result->visited_sigma.end(), sigma, sigma + n);
  EndWave(plan, sigma, &batch, [&](int ray, std::size_t i) {
    scratch->kept.x.push_back(wave.x[i]);
    scratch->kept.y.push_back(wave.y[i]);
    scratch->kept.z.push_back(wave.z[i]);
    scratch->kept.t.push_back(wave.t[i]);
    scratch->kept.delta.push_back(wave.delta[i]);
    scratch->kept_ray.push_back(ray);
    const Real* row = &scratch->wave_features[i * kInputs];
    scratch->kept_features.insert(scratch->kept_features.end(), row, row + kInputs);
  });
}

// Brings the kept samples into ray order. ray_first[r] is the first sample of ray r.
template <typename Real>
void SortByRay(ShardScratch<Real>* scratch, ShardResult<Real>* result, std::vector<int>* ray_first) {
  const std::size_t n = scratch->kept_ray.size();
  *ray_first = FirstSamples(scratch->batch);
  std::vector<int> next(ray_first->begin(), ray_first->end() - 1);
  Samples& samples = result->samples;
  samples.x.resize(n), samples.y.resize(n), samples.z.resize(n);
  Grow(&scratch->t, n), Grow(&scratch->delta, n), Grow(&scratch->features, n * kInputs);
  for (std::size_t i = 0; i < n; ++i) {
    const auto to = static_cast<std::size_t>(next[static_cast<std::size_t>(scratch->kept_ray[i])]++);
    samples.x[to] = scratch->kept.x[i];
    samples.y[to] = scratch->kept.y[i];
    samples.z[to] = scratch->kept.z[i];
    scratch->t[to] = scratch->kept.t[i];
    scratch->delta[to] = scratch->kept.delta[i];
    std::memcpy(
        &scratch->features[to * kInputs], &scratch->kept_features[i * kInputs], kInputs * sizeof(Real));
  }
}

// Colour of the ray whose samples are rows [begin, end); scratch->weights, at first opacities, become
// weights. Returns the transmittance at its end.
template <typename Real>
float CompositeRay(std::size_t begin,
                   std::size_t end,
                   const AlignedVector<float>& rgb,
                   ShardScratch<Real>* scratch,
                   float colour[3]) {
  float depth = 0, transmittance = 1;
  for (std::size_t i = begin; i < end; ++i) {
    scratch->weights[i] *= transmittance;
    depth += scratch->tau[i];
    transmittance = std::exp(-depth);
  }
  CompositeColour(
      static_cast<int>(end - begin), scratch->weights.data() + begin, rgb.data() + 3 * begin, colour);
  return transmittance;
}

// Distortion of the same ray, whose samples are those from `first` + begin on, times `scale`; its gradients
// are left in the scratch.
template <typename Real>
float DistortRay(
    std::size_t first, std::size_t begin, std::size_t end, float scale, ShardScratch<Real>* scratch) {
  const std::size_t n = end - begin;
  std::vector<float>&places = scratch->places, &lengths = scratch->lengths,
  &gradients = scratch->distortion_gradients;
  places.resize(n), lengths.resize(n), gradients.assign(n, 0.f);
  if (scale == 0) return 0;
  for (std::size_t i = 0; i < n; ++i) {
    const float t = scratch->t[first + begin + i];
    places[i] = std::log(t), lengths[i] = scratch->delta[first + begin + i] / t;
  }
  const float loss = Distortion(
      static_cast<int>(n), scratch->weights.data() + begin, places.data(), lengths.data(), gradients.data());
  for (float& gradient : gradients) gradient *= scale;
  return scale * loss;
}

// Gradients of the same ray, from the loss of its pixel and its distortion.
template <typename Real>
void DifferentiateRay(std::size_t first,
                      std::size_t begin,
                      std::size_t end,
                      const AlignedVector<float>& rgb,
                      float transmittance_end,
                      const PixelLoss<float>& pixel,
                      float scale,
                      float full_gradient_distance,
                      ShardScratch<Real>* scratch) {
  float *logits = scratch->logit_gradients.data(), *log_sigma = scratch->log_sigma_gradients.data();
  CompositeGradients(static_cast<int>(end - begin),
                     scratch->weights.data() + begin,
                     rgb.data() + 3 * begin,
                     transmittance_end,
                     pixel,
                     scale,
                     logits + 3 * begin,
                     log_sigma + begin,
                     scratch->distortion_gradients.data());
  // sigma = exp(logit) and rgb = sigmoid(logit).
  for (std::size_t i = begin; i < end; ++i) log_sigma[i] *= scratch->tau[i];
  for (std::size_t i = 3 * begin; i < 3 * end; ++i) logits[i] *= rgb[i] * (1.f - rgb[i]);
  for (std::size_t i = begin; i < end; ++i) {
    const float share = scratch->t[first + i] / full_gradient_distance;
    if (!(share < 1)) continue;
    log_sigma[i] *= share * share;
    for (std::size_t j = 3 * i; j < 3 * i + 3; ++j) logits[j] *= share * share;
  }
}

// Loss and gradients of the rays [ray_begin, ray_end), whose samples are the rows from `first` on.
template <typename Real>
void DifferentiateRays(const HashNetwork<Real>& network,
                       const BatchPlan& plan,
                       int ray_begin,
                       int ray_end,
                       const std::vector<int>& ray_first,
                       ShardScratch<Real>* scratch,
                       ShardResult<Real>* result) {
  const kernels::Kernels& kernels = kernels::ActiveKernels();
  const auto first = static_cast<std::size_t>(ray_first[static_cast<std::size_t>(ray_begin)]);
  const auto n = static_cast<std::size_t>(ray_first[static_cast<std::size_t>(ray_end)]) - first;
  NetworkRows<Real>& rows = scratch->rows;
  rows.Resize(static_cast<int>(n));
  std::memcpy(rows.features.data(), &scratch->features[first * kInputs], n * kInputs * sizeof(Real));
  network.QueryDensity(&rows);
  Grow(&scratch->tau, n), Grow(&scratch->weights, n), Grow(&scratch->logit_gradients, 3 * n),
      Grow(&scratch->log_sigma_gradients, n);
  for (std::size_t i = 0; i < n; ++i)
    scratch->tau[i] = scratch->weights[i] = rows.sigma[i] * scratch->delta[first + i];
  kernels.one_minus_exp_neg(static_cast<int>(n), scratch->weights.data());
  for (int r = ray_begin; r < ray_end; ++r) {
    const int begin = ray_first[static_cast<std::size_t>(r)],
              end = ray_first[static_cast<std::size_t>(r) + 1];
    const int offset = static_cast<int>(first);
    network.SetDirection(
        scratch->batch.rays[static_cast<std::size_t>(r)].ray.direction, begin - offset, end - offset, &rows);
  }
  network.QueryColour(&rows);

  std::vector<float> transmittance_end;
  for (int r = ray_begin; r < ray_end; r += plan.pixel_rays) {
    const auto begin_of = [&](int ray) {
      return static_cast<std::size_t>(ray_first[static_cast<std::size_t>(ray)]) - first;
    };
    // The pixel is the mean of its rays.
    const float share = 1.f / static_cast<float>(plan.pixel_rays);
    float colour[3] = {}, transmittance = 0;
    transmittance_end.clear();
    for (int i = r; i < r + plan.pixel_rays; ++i) {
      float ray_colour[3];
      transmittance_end.push_back(CompositeRay(begin_of(i), begin_of(i + 1), rows.rgb, scratch, ray_colour));
      transmittance += share * transmittance_end.back();
      for (int j = 0; j < 3; ++j) colour[j] += share * ray_colour[j];
    }
    const BatchRay& ray = scratch->batch.rays[static_cast<std::size_t>(r)];
    const PixelLoss<float> pixel = LossOf(colour, transmittance, ray.target);
    for (int i = r; i < r + plan.pixel_rays; ++i) {
      result->loss += share * DistortRay(first, begin_of(i), begin_of(i + 1), plan.distortion, scratch);
      DifferentiateRay(first,
                       begin_of(i),
                       begin_of(i + 1),
                       rows.rgb,
                       transmittance_end[static_cast<std::size_t>(i - r)],
                       pixel,
                       1.f / static_cast<float>(plan.n_rays),
                       plan.full_gradient_distance,
                       scratch);
    }
    if (!std::isfinite(pixel.loss) && result->finite) {
      result->finite = false;
      result->first_bad_ray = ray.id;
    }
    result->loss += pixel.loss;
    result->squared_error += pixel.squared_error;
    result->opacity += 1.f - transmittance;
  }
  network.Backward(scratch->logit_gradients.data(),
                   scratch->log_sigma_gradients.data(),
                   &rows,
                   result->weight_gradients.data());
}

}  // namespace

template <typename Real>
void TrainShard(const Dataset& dataset,
                const HashGrid& grid,
                const HashNetwork<Real>& network,
                const Sampler& sampler,
                const BatchPlan& plan,
                int shard,
                ShardScratch<Real>* scratch,
                ShardResult<Real>* result) {
  result->visited_cell.clear();
  result->visited_sigma.clear();
  result->weight_gradients.assign(network.n_weights(), 0.f);
  result->loss = result->squared_error = result->opacity = 0;
  result->finite = true;
  scratch->kept.clear();
  scratch->kept_ray.clear();
  scratch->kept_features.clear();

  DrawRays(dataset, sampler, plan, shard, &scratch->batch);
  while (NextWave(sampler, plan, &scratch->batch)) QueryWave(grid, network, plan, scratch, result);
  std::vector<int> ray_first;
  SortByRay(scratch, result, &ray_first);

  const auto n_levels = grid.levels().size();
  const std::size_t stride = scratch->kept_ray.size() * kernels::kFeatures;
  result->feature_gradient_stride = stride;
  Grow(&result->feature_gradients, stride * n_levels);
  const int n_rays = static_cast<int>(scratch->batch.rays.size());
  for (int ray_begin = 0; ray_begin < n_rays;) {
    int ray_end = ray_begin + plan.pixel_rays;
    const auto first_of = [&](int r) { return ray_first[static_cast<std::size_t>(r)]; };
    while (ray_end < n_rays && first_of(ray_end + plan.pixel_rays) - first_of(ray_begin) <= kChunkRows)
      ray_end += plan.pixel_rays;
    DifferentiateRays(network, plan, ray_begin, ray_end, ray_first, scratch, result);

    const NetworkRows<Real>& rows = scratch->rows;
    const auto n = static_cast<std::size_t>(rows.n), first = static_cast<std::size_t>(first_of(ray_begin));
    if (result->finite && !kernels::ActiveKernels().Network<Real>().all_finite(
                              static_cast<int>(n * kInputs), rows.features_gradient.data())) {
      result->finite = false;
      result->first_bad_ray = scratch->batch.rays[static_cast<std::size_t>(ray_begin)].id;
    }
    for (std::size_t l = 0; l < n_levels; ++l) {
      Real* target = result->feature_gradients.data() + l * stride + first * kernels::kFeatures;
      for (std::size_t i = 0; i < n; ++i) {
        std::memcpy(target + i * kernels::kFeatures,
                    &rows.features_gradient[i * kInputs + l * kernels::kFeatures],
                    kernels::kFeatures * sizeof(Real));
      }
    }
    ray_begin = ray_end;
  }
}

template void TrainShard(const Dataset&,
                         const HashGrid&,
                         const HashNetwork<float>&,
                         const Sampler&,
                         const BatchPlan&,
                         int,
                         ShardScratch<float>*,
                         ShardResult<float>*);
template void TrainShard(const Dataset&,
                         const HashGrid&,
                         const HashNetwork<kernels::Bf16>&,
                         const Sampler&,
                         const BatchPlan&,
                         int,
                         ShardScratch<kernels::Bf16>*,
                         ShardResult<kernels::Bf16>*);

}  // namespace nerf
