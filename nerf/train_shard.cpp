#include "nerf/train_shard.h"

#include <cmath>
#include <cstring>

#include "nerf/random.h"

namespace nerf {
namespace {

// Rows that go through the networks together: their activations (about 1.2 KB a row) stay in a 1 MB second-level cache.
constexpr int kChunkRows = 512;

PixelTarget TargetOf(const Dataset& dataset, std::size_t pixel) {
  const std::uint8_t* p = &dataset.pixels[pixel * static_cast<std::size_t>(dataset.channels)];
  const float alpha = dataset.channels == 4 ? static_cast<float>(p[3]) / 255.f : 1.f;
  PixelTarget target = {{}, alpha};
  for (int j = 0; j < 3; ++j) target.premultiplied[j] = static_cast<float>(p[j]) / 255.f * alpha;
  return target;
}

// Draws the shard's rays and marches them. Rays that meet nothing have a constant loss and no gradient: only their loss
// is counted.
void DrawRays(const Dataset& dataset,
              const Sampler& sampler,
              const BatchPlan& plan,
              int shard,
              ShardScratch* scratch,
              ShardResult* result) {
  const auto first = static_cast<std::uint64_t>(plan.n_rays) * static_cast<std::uint64_t>(shard) / kShards;
  const auto last = static_cast<std::uint64_t>(plan.n_rays) * static_cast<std::uint64_t>(shard + 1) / kShards;
  scratch->marched.clear();
  scratch->ray_first.clear();
  scratch->targets.clear();
  scratch->rays.clear();
  scratch->ray_ids.clear();
  for (std::uint64_t id = first; id < last; ++id) {
    Random random(plan.seed, Stream::kRay, plan.step, 2 * id);
    const std::size_t pixel = random.Below(static_cast<std::uint32_t>(dataset.n_pixels()));
    const View& view = dataset.ViewOf(pixel);
    const int in_view = static_cast<int>(pixel - view.first_pixel);
    const Ray ray = view.camera.RayThrough(in_view % view.width, in_view / view.width);
    const PixelTarget target = TargetOf(dataset, pixel);
    float t, t_last;
    sampler.Range(ray, &t, &t_last);
    t += random.Uniform() * sampler.Delta(plan.step_scale, t);
    const int begin = scratch->marched.size();
    const int n = sampler.March(ray, plan.step_scale, t_last, plan.max_samples, &t, &scratch->marched);
    if (n == 0) {
      float squared_error = 0;
      result->loss += CompositeLoss<float>(0, nullptr, nullptr, nullptr, 1.f, target, 0.f, nullptr, nullptr, &squared_error);
      result->squared_error += squared_error;
      continue;
    }
    scratch->ray_first.push_back(begin);
    scratch->targets.push_back(target);
    scratch->rays.push_back(ray);
    scratch->ray_ids.push_back(id);
  }
  scratch->ray_first.push_back(scratch->marched.size());
}

template <typename T>
void Grow(std::vector<T>* v, std::size_t size) {
  if (v->size() < size) v->resize(size);
}

// Density, transmittance and weights of the rays [ray_begin, ray_end); keeps only samples that light reaches, moved to
// the front of scratch->rows. first_alive receives the first kept row of each ray.
void RenderDensity(const HashField& field,
                   const kernels::Kernels& kernels,
                   int ray_begin,
                   int ray_end,
                   ShardScratch* scratch,
                   ShardResult* result,
                   std::vector<int>* first_alive,
                   std::vector<float>* transmittance_end) {
  const int first = scratch->ray_first[static_cast<std::size_t>(ray_begin)];
  const int n = scratch->ray_first[static_cast<std::size_t>(ray_end)] - first;
  FieldRows& rows = scratch->rows;
  rows.Resize(n);
  const float* features = &scratch->features[static_cast<std::size_t>(first) * HashField::kInputs];
  field.QueryDensity(features, &rows);

  const auto count = static_cast<std::size_t>(n);
  Grow(&scratch->tau, count), Grow(&scratch->alpha, count), Grow(&scratch->weights, count);
  const Samples& marched = scratch->marched;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t s = static_cast<std::size_t>(first) + i;
    scratch->tau[i] = scratch->alpha[i] = rows.sigma[i] * marched.delta[s];
    result->visited_cell.push_back(marched.cell[s]);
    result->visited_sigma.push_back(rows.sigma[i]);
  }
  kernels.one_minus_exp_neg(n, scratch->alpha.data());

  first_alive->clear();
  transmittance_end->clear();
  std::size_t kept = 0;
  for (int r = ray_begin; r < ray_end; ++r) {
    first_alive->push_back(static_cast<int>(kept));
    const auto begin = static_cast<std::size_t>(scratch->ray_first[static_cast<std::size_t>(r)] - first);
    const auto end = static_cast<std::size_t>(scratch->ray_first[static_cast<std::size_t>(r) + 1] - first);
    float depth = 0, transmittance = 1;
    for (std::size_t i = begin; i < end && !(transmittance < kEarlyStopTransmittance); ++i, ++kept) {
      const std::size_t s = static_cast<std::size_t>(first) + i;
      depth += scratch->tau[i];
      const float after = std::exp(-depth);
      scratch->weights[kept] = transmittance * scratch->alpha[i];
      transmittance = after;
      scratch->tau[kept] = scratch->tau[i];
      std::memmove(&rows.hidden[kept * HashField::kHidden], &rows.hidden[i * HashField::kHidden], HashField::kHidden * sizeof(float));
      std::memmove(&rows.out[kept * HashField::kOutputs], &rows.out[i * HashField::kOutputs], HashField::kOutputs * sizeof(float));
      std::memcpy(&rows.features[kept * HashField::kInputs], features + i * HashField::kInputs, HashField::kInputs * sizeof(float));
      result->samples.x.push_back(marched.x[s]);
      result->samples.y.push_back(marched.y[s]);
      result->samples.z.push_back(marched.z[s]);
    }
    transmittance_end->push_back(transmittance);
  }
  first_alive->push_back(static_cast<int>(kept));
  rows.n = static_cast<int>(kept);
}

// The harmonics of each ray's direction beside its samples' density outputs.
void FillHarmonics(const ShardScratch& scratch, int ray_begin, const std::vector<int>& first_alive, FieldRows* rows) {
  for (std::size_t r = 0; r + 1 < first_alive.size(); ++r) {
    float harmonics[kHarmonics];
    SphericalHarmonics(scratch.rays[static_cast<std::size_t>(ray_begin) + r].direction, harmonics);
    for (int i = first_alive[r]; i < first_alive[r + 1]; ++i) {
      std::memcpy(&rows->colour_in[static_cast<std::size_t>(i) * HashField::kInputs + HashField::kOutputs], harmonics, sizeof harmonics);
    }
  }
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
  const kernels::Kernels& kernels = kernels::ActiveKernels();
  result->samples.clear();
  result->visited_cell.clear();
  result->visited_sigma.clear();
  result->weight_gradients.assign(field.n_weights(), 0.f);
  result->loss = result->squared_error = result->opacity = 0;
  result->finite = true;
  DrawRays(dataset, sampler, plan, shard, scratch, result);

  const int n_marched = scratch->marched.size();
  const auto n_levels = field.levels().size();
  const auto stride = static_cast<std::size_t>(n_marched) * kernels::kFeatures;  // of one level's gradients
  Grow(&scratch->features, static_cast<std::size_t>(n_marched) * HashField::kInputs);
  Grow(&result->feature_gradients, stride * n_levels);
  field.Encode(scratch->marched, 0, n_marched, scratch->features.data());

  const float scale = 1.f / static_cast<float>(plan.n_rays);
  const int n_rays = static_cast<int>(scratch->rays.size());
  std::vector<int> first_alive;
  std::vector<float> transmittance_end;
  FieldRows& rows = scratch->rows;
  std::size_t done = 0;  // kept samples of earlier chunks
  for (int ray_begin = 0; ray_begin < n_rays;) {
    int ray_end = ray_begin + 1;
    const auto first_of = [&](int r) { return scratch->ray_first[static_cast<std::size_t>(r)]; };
    while (ray_end < n_rays && first_of(ray_end + 1) - first_of(ray_begin) <= kChunkRows) ++ray_end;
    RenderDensity(field, kernels, ray_begin, ray_end, scratch, result, &first_alive, &transmittance_end);
    FillHarmonics(*scratch, ray_begin, first_alive, &rows);
    field.QueryColour(&rows);

    const auto n = static_cast<std::size_t>(rows.n);
    Grow(&scratch->logit_gradients, 3 * n), Grow(&scratch->log_sigma_gradients, n);
    for (std::size_t r = 0; r + 1 < first_alive.size(); ++r) {
      const auto begin = static_cast<std::size_t>(first_alive[r]);
      float squared_error = 0;
      const float loss = CompositeLoss<float>(first_alive[r + 1] - first_alive[r],
                                              &scratch->tau[begin],
                                              &scratch->weights[begin],
                                              &rows.rgb[3 * begin],
                                              transmittance_end[r],
                                              scratch->targets[static_cast<std::size_t>(ray_begin) + r],
                                              scale,
                                              &scratch->logit_gradients[3 * begin],
                                              &scratch->log_sigma_gradients[begin],
                                              &squared_error);
      if (!std::isfinite(loss) && result->finite) {
        result->finite = false;
        result->first_bad_ray = scratch->ray_ids[static_cast<std::size_t>(ray_begin) + r];
      }
      result->loss += loss;
      result->squared_error += squared_error;
      result->opacity += 1.f - transmittance_end[r];
    }
    field.Backward(scratch->logit_gradients.data(), scratch->log_sigma_gradients.data(), &rows, result->weight_gradients.data());
    if (!AllFinite(rows.features_gradient.data(), n * HashField::kInputs) && result->finite) {
      result->finite = false;
      result->first_bad_ray = scratch->ray_ids[static_cast<std::size_t>(ray_begin)];
    }
    for (std::size_t l = 0; l < n_levels; ++l) {
      float* target = &result->feature_gradients[l * stride + done * kernels::kFeatures];
      for (std::size_t i = 0; i < n; ++i) {
        std::memcpy(target + i * kernels::kFeatures,
                    &rows.features_gradient[i * HashField::kInputs + l * kernels::kFeatures],
                    kernels::kFeatures * sizeof(float));
      }
    }
    done += n;
    ray_begin = ray_end;
  }
  result->feature_gradient_stride = stride;
}

}  // namespace nerf
