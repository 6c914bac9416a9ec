// The hand-written gradient of a whole training shard of the `hash` field - marched rays, grid, networks,
// compositing, loss - against LibTorch's automatic one of the same equations in double.
#include <ATen/ATen.h>
#include <gtest/gtest.h>
#include <torch/csrc/autograd/autograd.h>

#include "io/base/random.h"
#include "nerf/fields/hash_field.h"
#include "nerf/fields/spherical_harmonics.h"
#include "nerf/kernels/reference.h"
#include "nerf/steps/hash_shard.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"
#include "tests/support/scenes/field_tensor.h"

namespace nerf {
namespace {

using tests::TensorOf;

constexpr int kRays = 48;

struct Case {
  const char* name;
  int samples_per_pixel = 1;
  float distortion = 0, full_gradient_distance = 0, depth_weight = 0, nearness_weight = 0;
  bool ends_at_infinity = false;
  // With bfloat16. Where all light is accounted for, densities move only by differences of colours, which are
  // small in an untrained field, while their rounding errors are not: float shows that the equations agree.
  double bf16_tolerance = 0.03;
  float sky_weight = 0;
};

at::Tensor Parameter(std::span<const float> values) {
  return at::from_blob(const_cast<float*>(values.data()), {static_cast<std::int64_t>(values.size())})
      .to(at::kDouble)
      .clone()
      .requires_grad_(true);
}

at::Tensor Doubles(const std::vector<double>& values) {
  return at::from_blob(
             const_cast<double*>(values.data()), {static_cast<std::int64_t>(values.size())}, at::kDouble)
      .clone();
}

// Rows of trilinear features [n][32].
at::Tensor Encode(const std::vector<kernels::GridLevel>& levels,
                  const Samples& samples,
                  const at::Tensor& table) {
  std::vector<at::Tensor> features;
  const auto n = static_cast<std::size_t>(samples.size());
  for (const kernels::GridLevel& level : levels) {
    std::vector<std::int64_t> entries;
    std::vector<double> weights;
    for (std::size_t i = 0; i < n; ++i) {
      for (int c = 0; c < 8; ++c) {
        std::size_t entry;
        double weight;
        kernels::reference::Corner<double>(
            level, samples.x[i], samples.y[i], samples.z[i], c, &entry, &weight);
        entries.push_back(static_cast<std::int64_t>(level.first_entry + entry));
        weights.push_back(weight);
      }
    }
    const at::Tensor index =
        at::from_blob(entries.data(), {static_cast<std::int64_t>(entries.size())}, at::kLong);
    const at::Tensor corners = table.view({-1, kernels::kFeatures}).index_select(0, index.clone());
    features.push_back((corners * Doubles(weights).unsqueeze(1)).view({-1, 8, kernels::kFeatures}).sum(1));
  }
  return at::cat(features, 1);
}

struct Outputs {
  at::Tensor sigma, rgb;  // [n], [n][3]
};

Outputs Network(const at::Tensor& features, const at::Tensor& harmonics, const at::Tensor& weights) {
  std::int64_t at = 0;
  const auto layer = [&](std::int64_t inputs, std::int64_t outputs) {
    const at::Tensor w = weights.narrow(0, at, inputs * outputs).view({inputs, outputs});
    at += inputs * outputs;
    return w;
  };
  const at::Tensor out = at::relu(features.mm(layer(32, 64))).mm(layer(64, 16));
  const at::Tensor first = at::relu(at::cat({out, harmonics}, 1).mm(layer(32, 64)));
  const at::Tensor second = at::relu(first.mm(layer(64, 64)));
  const at::Tensor rgb = at::sigmoid(second.mm(layer(3, 64).view({3, 64}).t()));
  return {at::exp(out.select(1, 0) + HashNetwork<float>::kDensityBias), rgb};
}

// The squared error's mean over all backgrounds in [0, 1], with the moments 1/2 and 1/3.
at::Tensor Loss(const PixelTarget& target, const at::Tensor& colour, const at::Tensor& transmittance) {
  const at::Tensor leak = transmittance - (1 - double{target.alpha});
  at::Tensor loss = at::zeros({}, at::kDouble);
  for (int j = 0; j < 3; ++j) {
    const at::Tensor error = colour[j] - double{target.premultiplied[j]};
    loss = loss + 0.5 * (error * error + error * leak + leak * leak / 3);
  }
  return loss;
}

template <typename Real>
class HashGradientTest : public testing::Test {
 protected:
  // Relative to the norm of a gradient. With bfloat16 each factor carries 8 bits; errors mostly cancel.
  static constexpr bool kBf16 = sizeof(Real) == 2;
  static double ToleranceOf(const Case& c) { return kBf16 ? c.bf16_tolerance : 2e-5; }

  HashGradientTest()
      : scene_(tests::BallScene(dir_.path(), 4, 0, {.size = 24})),
        contraction_(SceneContraction::FromScene(scene_, false)),
        grid_(64, contraction_),
        field_(
            {.grid = {.n_levels = 8, .log2_hashmap_size = 8, .base_resolution = 3, .finest_resolution = 40},
             .bf16_network = kBf16},
            5) {
    for (std::uint32_t cell = 0; cell < grid_.n_cells(); ++cell) grid_.SetCandidate(cell);
    grid_.Rebuild();
    const std::span<float> table = TensorOf(&field_, "table");
    for (std::size_t i = 0; i < table.size(); ++i)  // features of useful size, so that no path is dead
      table[i] = io::Random(9, io::Stream::kInit, 2, i).Uniform() - 0.5f;
    table_ = Parameter(table);
    weights_ = Parameter(TensorOf(&field_, "weights"));
    field_.Refresh();
  }

  void Train(const Case& c) {
    const Sampler sampler({.near = 2, .far = 6, .step_size = 0.1f}, contraction_, grid_);
    // Every sample counts, so that the reference needs no choice of its own.
    const BatchPlan plan{.seed = 3,
                         .n_rays = kRays,
                         .samples_per_pixel = c.samples_per_pixel,
                         .n_shards = 1,
                         .distortion = c.distortion,
                         .full_gradient_distance = c.full_gradient_distance,
                         .ends_at_infinity = c.ends_at_infinity,
                         .depth_share = c.depth_weight > 0 ? 0.5f : 0,
                         .depth_weight = c.depth_weight,
                         .near_cameras = c.nearness_weight > 0 ? &near_cameras_ : nullptr,
                         .nearness_weight = c.nearness_weight,
                         .sky_weight = c.sky_weight,
                         .early_stop_depth = 1e9f,
                         .wave_samples = 4};
    Dataset dataset = LoadDataset(scene_, 1);
    for (std::size_t v = 0; v < dataset.views.size(); ++v)
      dataset.depths.push_back({.view = v, .point = 0, .x = 12.3f, .y = 11.6f, .t = 3.5f});
    for (std::size_t i = 0; c.sky_weight > 0 && i < dataset.n_pixels(); ++i)
      dataset.sky.push_back(i % 2 == 0);
    const HashShardContext<Real> context{
        dataset, field_.grid(), std::get<HashNetwork<Real>>(field_.network()), sampler, plan};
    HashShardScratch<Real> scratch;
    RunHashShard(context, 0, &scratch, &shard_);
    DrawRays(dataset, sampler, plan, 0, &batch_);
  }

  // Returns the sum of the pixels' losses; fills the gradients of table_ and weights_.
  double TrainReference(const Case& c) {
    const Samples& samples = shard_.samples.sorted;
    const std::vector<BatchRay>& rays = batch_.rays;
    const auto n_samples = [&](std::size_t ray) {
      return shard_.samples.ray_first[ray + 1] - shard_.samples.ray_first[ray];
    };
    std::vector<double> harmonics, deltas(samples.delta.begin(), samples.delta.end());
    for (std::size_t r = 0; r < rays.size(); ++r) {
      const float* direction = rays[r].ray.direction;
      const double d[3] = {direction[0], direction[1], direction[2]};
      double values[kHarmonics];
      SphericalHarmonics(d, values);
      for (int i = 0; i < n_samples(r); ++i) harmonics.insert(harmonics.end(), values, values + kHarmonics);
    }
    Outputs outputs = Network(
        Encode(field_.grid().levels(), samples, table_), Doubles(harmonics).view({-1, kHarmonics}), weights_);
    if (c.full_gradient_distance > 0) {
      std::vector<double> shares(samples.t.begin(), samples.t.end());
      for (double& share : shares) share = std::pow(std::min(share / c.full_gradient_distance, 1.0), 2);
      const at::Tensor share = Doubles(shares);
      outputs.sigma = share * outputs.sigma + (1 - share) * outputs.sigma.detach();
      outputs.rgb = share.unsqueeze(1) * outputs.rgb + (1 - share.unsqueeze(1)) * outputs.rgb.detach();
    }
    std::vector<double> ends(deltas.size());  // 30 at infinity, where light ends whatever the density is
    for (std::size_t i = 0; i < ends.size(); ++i) ends[i] = std::isinf(samples.t[i]) ? 30 : 0;
    const at::Tensor tau = outputs.sigma * Doubles(deltas) + Doubles(ends);
    at::Tensor loss = at::zeros({}, at::kDouble);
    std::int64_t first = 0;
    at::Tensor pixel_colour, pixel_transmittance;
    for (std::size_t r = 0; r < rays.size(); ++r) {
      const BatchRay& ray = rays[r];
      const at::Tensor own = tau.narrow(0, first, n_samples(r)), depth = own.cumsum(0);
      const at::Tensor weights = at::exp(own - depth) * (1 - at::exp(-own));
      const at::Tensor colour =
          weights.matmul(outputs.rgb.narrow(0, first, n_samples(r))) / c.samples_per_pixel;
      const at::Tensor transmittance = at::exp(-own.sum()) / c.samples_per_pixel;
      loss = loss + Distortion(weights, static_cast<std::size_t>(first)) * double{c.distortion} /
                        c.samples_per_pixel;
      if (ray.depth > 0)
        loss = loss + DepthLoss(weights, static_cast<std::size_t>(first), ray.depth) *
                          double{c.depth_weight} / c.samples_per_pixel;
      loss = loss + Nearness(weights, static_cast<std::size_t>(first), ray.ray) * double{c.nearness_weight} /
                        c.samples_per_pixel;
      if (ray.shows_sky) {
        for (std::int64_t i = 0; i < n_samples(r); ++i) {
          if (!std::isinf(samples.t[static_cast<std::size_t>(first + i)]))
            loss = loss + weights[i] * double{c.sky_weight} / c.samples_per_pixel;
        }
      }
      first += n_samples(r);
      const bool begins = r % static_cast<std::size_t>(c.samples_per_pixel) == 0;
      pixel_colour = begins ? colour : pixel_colour + colour;
      pixel_transmittance = begins ? transmittance : pixel_transmittance + transmittance;
      if ((r + 1) % static_cast<std::size_t>(c.samples_per_pixel) == 0)
        loss = loss + Loss(ray.target, pixel_colour, pixel_transmittance);
    }
    (loss * c.samples_per_pixel / kRays).backward();
    return loss.item<double>();
  }

  // Of a ray with the given weights and the samples from `first` on, by its definition.
  at::Tensor Distortion(const at::Tensor& weights, std::size_t first) const {
    const Samples& samples = shard_.samples.sorted;
    std::vector<double> places, lengths;
    for (std::size_t i = first; i < first + static_cast<std::size_t>(weights.numel()); ++i) {
      if (std::isinf(samples.t[i])) break;
      places.push_back(std::log(double{samples.t[i]}));
      lengths.push_back(double{samples.delta[i]} / double{samples.t[i]});
    }
    const at::Tensor s = Doubles(places), between = (s.unsqueeze(0) - s.unsqueeze(1)).abs();
    const at::Tensor w = weights.narrow(0, 0, static_cast<std::int64_t>(places.size()));
    return w.dot(between.mv(w)) + (w * w).dot(Doubles(lengths)) / 3;
  }

  // Of the same: free within 1 % of the depth, rising to 1 at 11 %.
  at::Tensor DepthLoss(const at::Tensor& weights, std::size_t first, double depth) const {
    std::vector<double> penalties;
    for (std::size_t i = first; i < first + static_cast<std::size_t>(weights.numel()); ++i) {
      const double off = std::fabs(std::log(double{shard_.samples.sorted.t[i]} / depth));
      penalties.push_back(off < 0.01 ? 0 : off < 0.11 ? (off - 0.01) / 0.1 : 1);
    }
    return weights.dot(Doubles(penalties));
  }

  // Of the same and their ray: 1 at the camera that counts as the nearest, 0 from a distance of 4 on.
  at::Tensor Nearness(const at::Tensor& weights, std::size_t first, const Ray& ray) const {
    const Samples& samples = shard_.samples.sorted;
    std::vector<double> values;
    for (std::size_t i = first; i < first + static_cast<std::size_t>(weights.numel()); ++i) {
      std::array<float, 3> place;
      for (std::size_t j = 0; j < 3; ++j) place[j] = ray.origin[j] + samples.t[i] * ray.direction[j];
      values.push_back(
          std::isinf(samples.t[i]) ? 0 : near_cameras_.At({samples.x[i], samples.y[i], samples.z[i]}, place));
    }
    return weights.dot(Doubles(values));
  }

  // Gradient of the table, from those of the features.
  std::vector<float> TableGradient() const {
    std::vector<float> gradient(static_cast<std::size_t>(table_.numel()), 0.f);
    const auto& levels = field_.grid().levels();
    for (std::size_t l = 0; l < levels.size(); ++l) {
      kernels::ActiveKernels().Network<Real>().scatter(
          levels[l],
          &shard_.feature_gradients[l * shard_.feature_gradient_stride],
          shard_.samples.sorted.x.data(),
          shard_.samples.sorted.y.data(),
          shard_.samples.sorted.z.data(),
          shard_.samples.sorted.size(),
          &gradient[levels[l].first_entry * kernels::kFeatures]);
    }
    return gradient;
  }

  static double RelativeError(const std::vector<float>& ours, const at::Tensor& reference) {
    const at::Tensor difference = Parameter(ours).detach() - reference;
    return (difference.norm() / reference.norm()).template item<double>();
  }

  TempDir dir_;
  io::Scene scene_;
  SceneContraction contraction_;
  OccupancyGrid grid_;
  HashField field_;
  io::Workers workers_{1};
  NearCameras near_cameras_{scene_, contraction_, 4, &workers_};
  at::Tensor table_, weights_;
  RayBatch batch_;  // the rays of the shard, before they are marched
  HashShard<Real> shard_;
};
using Reals = testing::Types<float, kernels::Bf16>;
TYPED_TEST_SUITE(HashGradientTest, Reals);

TYPED_TEST(HashGradientTest, OfAShardIsThatOfTheReferenceInLibTorch) {
  for (const Case& c : {Case{"one ray per pixel"},
                        {"four", 4},
                        {"distortion", 1, 0.3f},
                        {"four with distortion", 4, 0.3f},
                        {"scaled near the camera", 1, 0.3f, 4},
                        {"depth", 1, 0, 0, 0.5f},
                        {"near cameras", 1, 0, 0, 0, 0.5f},
                        {"infinity", 1, 0, 0, 0, 0, true, 0.15},
                        {"sky", 1, 0, 0, 0, 0, true, 0.15, 0.5f},
                        {"all", 4, 0.3f, 4, 0.5f, 0.5f, true, 0.03, 0.5f}}) {
    SCOPED_TRACE(c.name);
    const double tolerance = this->ToleranceOf(c);
    this->Train(c);
    ASSERT_FALSE(this->shard_.loss.bad_ray);
    ASSERT_GT(this->shard_.samples.sorted.size(), 500);
    this->table_.mutable_grad() = this->weights_.mutable_grad() = at::Tensor();
    const double loss = this->TrainReference(c);
    EXPECT_NEAR(this->shard_.loss.loss, loss, tolerance * loss);
    EXPECT_LT(this->RelativeError(this->shard_.weight_gradients, this->weights_.grad()), tolerance);
    EXPECT_LT(this->RelativeError(this->TableGradient(), this->table_.grad()), tolerance);
  }
}

}  // namespace
}  // namespace nerf
