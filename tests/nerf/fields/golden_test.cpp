// One training step and ten losses of the `nerf` field with the report's settings against golden values of an
// independent implementation in double (tests/golden/nerf_step.py).
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/json.h"
#include "io/base/random.h"
#include "nerf/steps/field_training.h"
#include "nerf/steps/mlp_shard.h"
#include "nerf/training/trainer.h"
#include "tests/support/programs/torch_environment.h"
#include "tests/support/scenes/field_tensor.h"

namespace nerf {
namespace {

using io::Json;

constexpr std::uint64_t kSeed = 7;
constexpr int kRays = 8, kSamples = 16;
constexpr std::size_t kDensityLayer = 8;
// A step of bfloat16 moves some pre-activations across 0. That noise averages out over rays, and piles up
// backwards: the first layer's gradient has most of it.
constexpr int kBf16Rays = 512;
constexpr double kBf16FirstCosine = 0.995, kBf16Cosine = 0.999;

const Json& Golden() {
  static const Json golden = io::ParseJson(io::ReadFile(SOURCE_DIR "/tests/golden/nerf_step.json"));
  return golden;
}

std::vector<double> Values(const char* name) { return Golden()[name].get<std::vector<double>>(); }

template <typename Values>
std::vector<double> Doubles(const Values& values) {
  return {values.begin(), values.end()};
}

double Dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

double Cosine(const std::vector<double>& a, const std::vector<double>& b) {
  return Dot(a, b) / std::sqrt(Dot(a, a) * Dot(b, b));
}

double RelativeL2(std::vector<double> a, const std::vector<double>& b) {
  EXPECT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
  return std::sqrt(Dot(a, a) / Dot(b, b));
}

double MaxError(const std::vector<double>& a, const std::vector<double>& b) {
  EXPECT_EQ(a.size(), b.size());
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::fabs(a[i] - b[i]));
  return worst;
}

// One view of one pixel for each ray. No check of the rotation is in the way of any direction.
Dataset GoldenDataset() {
  const std::vector<double> origins = Values("origins"), directions = Values("directions");
  Dataset dataset;
  dataset.channels = 4;
  for (const double value : Values("rgba")) dataset.pixels.push_back(static_cast<std::uint8_t>(value));
  for (std::size_t r = 0; r < kRays; ++r) {
    const io::Camera camera{.width = 1, .height = 1, .fl_x = 1, .fl_y = 1, .cx = 0.5, .cy = 0.5};
    io::Rigid3d pose;
    pose.rotation.col(2) = -Eigen::Vector3d(&directions[3 * r]);
    pose.translation = Eigen::Vector3d(&origins[3 * r]);
    dataset.views.push_back({"", RayCamera(camera, pose), 1, 1, r});
  }
  return dataset;
}

TrainOptions GoldenOptions(bool bf16) {
  TrainOptions options = ReportTrainOptions();
  options.field.mlp.bf16 = bf16;
  options.field.mlp.quadrature.n_samples = kSamples;
  options.mlp.rays = kRays;
  return options;
}

std::unique_ptr<SceneField> GoldenField(bool bf16) {
  const MlpFieldOptions options = GoldenOptions(bf16).field.mlp;
  auto field = std::make_unique<MlpField>(options, false, kSeed);
  const std::span<float> weights = tests::TensorOf(field.get(), "weights");
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const auto word = static_cast<double>(io::Random(kSeed, io::Stream::kInit, 0, i).Bits() >> 48);
    weights[i] = static_cast<float>(5. / 32 * (word / 32768 - 1));
  }
  weights[Layers(MlpOptionsOf(options))[kDensityLayer].biases] -= 1.25f;
  field->Refresh();
  const SamplerOptions sampling{.near = 2, .far = 6, .scene_units = true};
  return std::make_unique<SceneField>(SceneContraction{{0, 0, 0}, 6, false}, sampling, std::move(field), 64);
}

const MlpField& FieldOf(const SceneField& scene_field) {
  return dynamic_cast<const MlpField&>(*scene_field.field);
}

struct GoldenStep {
  std::vector<BatchRay> rays;  // before they are sampled
  MlpShard shard;
};

GoldenStep RunGoldenStep(const SceneField& scene_field, int n_rays = kRays) {
  const Dataset dataset = GoldenDataset();
  const Sampler sampler(scene_field.sampler_options, scene_field.contraction, scene_field.grid);
  BatchPlan plan{.seed = kSeed, .step = 0, .n_rays = n_rays, .n_shards = 1};
  plan.background = {1, 1, 1};
  RayBatch batch;
  DrawRays(dataset, sampler, plan, 0, &batch);
  GoldenStep step{batch.rays, {}};
  RunMlpShard({dataset, FieldOf(scene_field), sampler, plan}, 0, &step.shard);
  return step;
}

// Rows that the network sees for the samples of a shard.
struct Codes {
  std::vector<float> position, direction;
};

Codes CodesOf(const SceneField& scene_field, const GoldenStep& step) {
  const MlpField& field = FieldOf(scene_field);
  const auto stride = static_cast<std::size_t>(CodeStride(MlpOptionsOf(field.options()).direction_inputs));
  Codes codes;
  field.EncodePositions(step.shard.samples.sorted, 0, kRays * kSamples, &codes.position);
  codes.direction.resize(stride * kRays * kSamples);
  for (std::size_t i = 0; i < kRays * kSamples; ++i)
    field.EncodeDirection(step.rays[i / kSamples].ray.direction, &codes.direction[i * stride]);
  return codes;
}

// The gradient of each weight matrix and bias vector, in the order of the golden values.
std::vector<std::vector<double>> Tensors(const std::vector<float>& gradients) {
  std::vector<std::vector<double>> tensors;
  for (const MlpLayer& layer : Layers(MlpOptionsOf(GoldenOptions(false).field.mlp))) {
    const auto at = gradients.begin();
    const auto weights = at + static_cast<std::ptrdiff_t>(layer.weights),
               biases = at + static_cast<std::ptrdiff_t>(layer.biases);
    tensors.emplace_back(weights, biases);
    tensors.emplace_back(biases, biases + layer.outputs);
  }
  return tensors;
}

TEST(MlpGolden, DistancesAndCodesAreThePapers) {
  const auto scene_field = GoldenField(false);
  const GoldenStep step = RunGoldenStep(*scene_field);
  EXPECT_LE(MaxError(Doubles(step.shard.samples.sorted.t), Values("distances")), 1e-9);
  const Codes codes = CodesOf(*scene_field, step);
  const std::vector<double> position = Values("position_codes"), direction = Values("direction_codes");
  double worst = 0;
  for (std::size_t i = 0; i < position.size(); ++i) {  // every second sample of the first rays is stored
    const float code = codes.position[i / 63 * 2 * 64 + i % 63];
    worst = std::max(worst, std::fabs(code - position[i]));
  }
  for (std::size_t i = 0; i < direction.size(); ++i) {
    const float code = codes.direction[i / 27 * kSamples * 32 + i % 27];
    worst = std::max(worst, std::fabs(code - direction[i]));
  }
  std::printf("codes: largest error %.1e\n", worst);
  EXPECT_LE(worst, 1e-6);
}

TEST(MlpGolden, OutputsWeightsAndLossAreThePapers) {
  const auto scene_field = GoldenField(false);
  const GoldenStep step = RunGoldenStep(*scene_field);
  const Codes codes = CodesOf(*scene_field, step);
  constexpr int kRows = kRays * kSamples;
  std::vector<float> raw(kRows), logits(3 * kRows), tau(kRows), weights(kRows), rgb(3 * kRows);
  FieldOf(*scene_field)
      .network(0)
      .Query(kRows, codes.position.data(), codes.direction.data(), raw.data(), logits.data());
  for (std::size_t i = 0; i < kRows; ++i)
    tau[i] = Density(DensityActivation::kRelu, raw[i]) * step.shard.samples.sorted.delta[i];
  for (std::size_t i = 0; i < 3 * kRows; ++i) rgb[i] = Sigmoid(logits[i]);
  Opacities(kRows, tau.data(), weights.data());
  std::vector<double> colours;
  for (std::size_t first = 0; first < kRows; first += kSamples) {
    float colour[3];
    const float end = WeightsFromOpacities(kSamples, &tau[first], &weights[first]);
    CompositeColour(kSamples, &weights[first], &rgb[3 * first], colour);
    for (const float c : colour) colours.push_back(c + end);
  }
  const double errors[] = {RelativeL2(Doubles(raw), Values("raw")),
                           RelativeL2(Doubles(logits), Values("logits")),
                           RelativeL2(Doubles(weights), Values("weights")),
                           RelativeL2(colours, Values("colours")),
                           std::fabs(step.shard.loss.loss / kRays / Golden()["loss"].get<double>() - 1)};
  const char* names[] = {"raw density", "colour logits", "weights", "colours", "loss"};
  for (std::size_t i = 0; i < std::size(errors); ++i) {
    std::printf("%s: relative error %.1e\n", names[i], errors[i]);
    EXPECT_LE(errors[i], 1e-5) << names[i];
  }
}

TEST(MlpGolden, TheGradientOfEveryTensorIsThePapers) {
  const auto scene_field = GoldenField(false);
  const auto tensors = Tensors(RunGoldenStep(*scene_field).shard.gradients);
  ASSERT_EQ(tensors.size(), Golden()["gradients"].size());
  double worst = 0;
  for (std::size_t k = 0; k < tensors.size(); ++k) {
    const Json& golden = Golden()["gradients"][k];
    const double norm = golden["norm"];
    EXPECT_NEAR(std::sqrt(Dot(tensors[k], tensors[k])) / norm, 1, 1e-5) << "tensor " << k;
    // Projections on random signs: the mean square of their errors is that of the whole tensor's error.
    std::vector<double> projections(16, 0.0), entries;
    for (std::size_t i = 0; i < tensors[k].size(); ++i) {
      io::Random random(kSeed, io::Stream::kInit, 1 + k, i);
      for (double& projection : projections)
        projection += random.Bits() >> 63 ? -tensors[k][i] : tensors[k][i];
    }
    std::vector<double> difference = golden["projections"];
    for (std::size_t i = 0; i < 16; ++i) difference[i] -= projections[i];
    const double error = std::sqrt(Dot(difference, difference) / 16) / norm;
    for (std::size_t i = 0; i < tensors[k].size(); i += golden["stride"].get<std::size_t>())
      entries.push_back(tensors[k][i]);
    const std::vector<double> wanted = golden["entries"].get<std::vector<double>>();
    const double of_entries = RelativeL2(entries, wanted);
    EXPECT_LE(error, 1e-5) << "tensor " << k;
    EXPECT_LE(of_entries, 1e-5) << "tensor " << k;
    EXPECT_GE(Cosine(entries, wanted), 1 - 1e-8) << "tensor " << k;
    worst = std::max({worst, error, of_entries});
  }
  std::printf("gradients: largest relative error of a tensor %.1e\n", worst);
}

// bfloat16 against float, which the test above has tied to the paper.
TEST(MlpGolden, Bf16GradientsPointTheSameWay) {
  const auto exact_field = GoldenField(false), field = GoldenField(true);
  const MlpShard exact_shard = RunGoldenStep(*exact_field, kBf16Rays).shard,
                 shard = RunGoldenStep(*field, kBf16Rays).shard;
  EXPECT_NEAR(shard.loss.loss / exact_shard.loss.loss, 1, 1e-2);
  const auto exact = Tensors(exact_shard.gradients), rounded = Tensors(shard.gradients);
  double worst = 1;
  for (std::size_t k = 0; k < exact.size(); ++k) {
    EXPECT_GE(Cosine(rounded[k], exact[k]), k < 2 ? kBf16FirstCosine : kBf16Cosine) << "tensor " << k;
    worst = std::min(worst, Cosine(rounded[k], exact[k]));
  }
  std::printf("bf16: smallest cosine of a tensor %.6f, loss %.1e off\n",
              worst,
              std::fabs(shard.loss.loss / exact_shard.loss.loss - 1));
}

// Adam included.
TEST(MlpGolden, TenTrainingStepsHaveTheGoldenLosses) {
  const std::vector<double> losses = Values("losses");
  ASSERT_EQ(losses.size(), 10u);
  const Dataset dataset = GoldenDataset();
  const TrainOptions options = GoldenOptions(false);
  const auto scene_field = GoldenField(false);
  io::Workers workers(1);
  const auto training = MakeMlpTraining(dataset, options, scene_field.get(), &workers);
  double worst = 0;
  TrainState state{.seed = kSeed};
  for (; state.step < losses.size(); ++state.step) {
    const StepOutcome outcome = training->Step(0.1 * static_cast<double>(state.step), &state);
    EXPECT_EQ(outcome.fault, "");
    EXPECT_NEAR(outcome.loss / losses[state.step], 1, 1e-5) << "step " << state.step;
    worst = std::max(worst, std::fabs(outcome.loss / losses[state.step] - 1));
  }
  std::printf("ten losses: largest relative error %.1e\n", worst);
}

}  // namespace
}  // namespace nerf
