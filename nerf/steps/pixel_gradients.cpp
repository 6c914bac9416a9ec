#include "nerf/steps/pixel_gradients.h"

#include <array>
#include <cmath>

#include "nerf/rendering/depth_loss.h"
#include "nerf/rendering/distortion.h"

namespace nerf {
namespace {

// The steps of CompositePixels over one chunk.
class Compositor {
 public:
  Compositor(const BatchPlan& plan,
             const std::vector<BatchRay>& rays,
             const ShardSamples& samples,
             const RayChunk& chunk,
             const float* rgb,
             PixelGradients* rows)
      : plan_(plan), rays_(rays), samples_(samples), chunk_(chunk), rgb_(rgb), rows_(*rows) {}

  // Colour and, as the result, transmittance of the pixel whose first ray is `first_ray`.
  float Composite(int first_ray, float colour[3]) {
    float transmittance = 0;
    rows_.transmittances.clear();
    for (int j = 0; j < 3; ++j) colour[j] = 0;
    for (int ray = first_ray; ray < first_ray + plan_.samples_per_pixel; ++ray) {
      const auto [begin, n] = RowsOf(ray);
      float ray_colour[3];
      rows_.transmittances.push_back(
          WeightsFromOpacities(n, rows_.tau.data() + begin, rows_.weights.data() + begin));
      CompositeColour(n, rows_.weights.data() + begin, rgb_ + 3 * begin, ray_colour);
      transmittance += Share() * rows_.transmittances.back();
      for (int j = 0; j < 3; ++j) colour[j] += Share() * ray_colour[j];
    }
    return transmittance;
  }

  // Fills the gradients of the same rays and adds what their weights cost to `loss`.
  void Differentiate(int first_ray, const PixelLoss<float>& pixel, ShardLoss* loss) {
    for (int ray = first_ray; ray < first_ray + plan_.samples_per_pixel; ++ray) {
      const auto [begin, n] = RowsOf(ray);
      rows_.weight_gradients.assign(static_cast<std::size_t>(n), 0.f);
      if (plan_.distortion > 0) loss->loss += Share() * Distort(ray);
      if (rays_[static_cast<std::size_t>(ray)].depth > 0) loss->loss += Share() * PullToDepth(ray);
      if (plan_.near_cameras) loss->loss += Share() * PushFromCameras(ray);
      if (rays_[static_cast<std::size_t>(ray)].shows_sky) loss->loss += Share() * ClearTheSky(ray);
      CompositeGradients(n,
                         rows_.weights.data() + begin,
                         rgb_ + 3 * begin,
                         rows_.transmittances[static_cast<std::size_t>(ray - first_ray)],
                         pixel,
                         1.f / static_cast<float>(plan_.n_rays),
                         rows_.rgb_gradients.data() + 3 * begin,
                         rows_.tau_gradients.data() + begin,
                         rows_.weight_gradients.data());
    }
  }

 private:
  struct Rows {
    std::size_t begin;
    int n;
  };
  Rows RowsOf(int ray) const {
    const std::size_t begin = samples_.First(ray);
    return {begin - chunk_.first, static_cast<int>(samples_.First(ray + 1) - begin)};
  }

  // Of one ray in its pixel.
  float Share() const { return 1.f / static_cast<float>(plan_.samples_per_pixel); }

  // Weighted distortion of one ray, up to infinity, whose gradients are left in the rows.
  float Distort(int ray) {
    const std::size_t begin = RowsOf(ray).begin;
    std::vector<float>&places = rows_.places, &lengths = rows_.lengths, &gradients = rows_.weight_gradients;
    places.clear(), lengths.clear();
    for (std::size_t i = samples_.First(ray); i < samples_.First(ray + 1); ++i) {
      if (std::isinf(samples_.sorted.t[i])) break;
      places.push_back(std::log(samples_.sorted.t[i]));
      lengths.push_back(samples_.sorted.delta[i] / samples_.sorted.t[i]);
    }
    const float loss = Distortion(static_cast<int>(places.size()),
                                  rows_.weights.data() + begin,
                                  places.data(),
                                  lengths.data(),
                                  gradients.data());
    for (float& gradient : gradients) gradient *= plan_.distortion;
    return plan_.distortion * loss;
  }

  // Weighted depth loss of one ray; its gradients are added to those in the rows.
  float PullToDepth(int ray) {
    const auto [begin, n] = RowsOf(ray);
    float loss = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
      const float gradient = plan_.depth_weight * DepthPenalty(samples_.sorted.t[samples_.First(ray) + i],
                                                               rays_[static_cast<std::size_t>(ray)].depth);
      rows_.weight_gradients[i] += gradient;
      loss += rows_.weights[begin + i] * gradient;
    }
    return loss;
  }

  // Weighted cost of light near the cameras, likewise.
  float PushFromCameras(int ray) {
    const auto [begin, n] = RowsOf(ray);
    const Samples& samples = samples_.sorted;
    const std::size_t first = samples_.First(ray);
    const Ray& r = rays_[static_cast<std::size_t>(ray)].ray;
    float loss = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
      const std::size_t s = first + i;
      const float t = samples.t[s];
      if (std::isinf(t)) break;
      std::array<float, 3> place;
      for (std::size_t j = 0; j < 3; ++j) place[j] = r.origin[j] + t * r.direction[j];
      const float gradient =
          plan_.nearness_weight * plan_.near_cameras->At({samples.x[s], samples.y[s], samples.z[s]}, place);
      rows_.weight_gradients[i] += gradient;
      loss += rows_.weights[begin + i] * gradient;
    }
    return loss;
  }

  // Weighted opacity of what stands before the sky, likewise.
  float ClearTheSky(int ray) {
    const auto [begin, n] = RowsOf(ray);
    float loss = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
      if (std::isinf(samples_.sorted.t[samples_.First(ray) + i])) break;
      rows_.weight_gradients[i] += plan_.sky_weight;
      loss += plan_.sky_weight * rows_.weights[begin + i];
    }
    return loss;
  }

  const BatchPlan& plan_;
  const std::vector<BatchRay>& rays_;
  const ShardSamples& samples_;
  const RayChunk& chunk_;
  const float* rgb_;
  PixelGradients& rows_;
};

}  // namespace

void CompositePixels(const BatchPlan& plan,
                     const std::vector<BatchRay>& rays,
                     const ShardSamples& samples,
                     const RayChunk& chunk,
                     const float* rgb,
                     PixelGradients* rows,
                     ShardLoss* loss) {
  Compositor compositor(plan, rays, samples, chunk, rgb, rows);
  for (int r = chunk.ray_begin; r < chunk.ray_end; r += plan.samples_per_pixel) {
    const BatchRay& ray = rays[static_cast<std::size_t>(r)];
    float colour[3];
    const float transmittance = compositor.Composite(r, colour);
    const PixelLoss<float> pixel = LossOf(colour, transmittance, ray.target);
    compositor.Differentiate(r, pixel, loss);
    if (!std::isfinite(pixel.loss) && !loss->bad_ray) loss->bad_ray = ray.id;
    loss->loss += pixel.loss;
    loss->squared_error += pixel.squared_error;
    loss->opacity += 1.f - transmittance;
  }
}

}  // namespace nerf
