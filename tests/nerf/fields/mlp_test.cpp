// The LibTorch network against its plain reference in double (tests/support/scenes/reference_mlp.h): outputs,
// gradients, threads and precision.
#include "nerf/fields/mlp.h"

#include <cmath>
#include <limits>
#include <thread>

#include "io/base/error.h"
#include "io/base/random.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/torch_environment.h"
#include "tests/support/scenes/reference_mlp.h"

namespace nerf {
namespace {

using Reference = tests::ReferenceMlp<double>;

// Rows of codes for a network, and gradients of its outputs.
struct Rows {
  int n;
  std::vector<float> position, direction, density_gradients, logit_gradients;
};

std::vector<float> RandomCodes(int n, int inputs, std::uint64_t stream) {
  std::vector<float> codes(static_cast<std::size_t>(n * CodeStride(inputs)), 0.f);
  for (int row = 0; row < n; ++row) {
    for (int i = 0; i < inputs; ++i) {
      const int at = row * CodeStride(inputs) + i;
      codes[static_cast<std::size_t>(at)] =
          2 * io::Random(stream, io::Stream::kInit, 1, static_cast<std::uint64_t>(at)).Uniform() - 1;
    }
  }
  return codes;
}

Rows MakeRows(const MlpOptions& options, int n) {
  Rows rows{n,
            RandomCodes(n, options.position_inputs, 1),
            RandomCodes(n, options.direction_inputs, 2),
            RandomCodes(n, 1, 3),
            RandomCodes(n, 3, 4)};
  rows.density_gradients.resize(static_cast<std::size_t>(n));
  rows.logit_gradients.resize(3 * static_cast<std::size_t>(n));
  for (std::size_t i = 0; i < rows.density_gradients.size(); ++i)
    rows.density_gradients[i] = io::Random(3, io::Stream::kInit, 1, i).Uniform() - 0.3f;
  for (std::size_t i = 0; i < rows.logit_gradients.size(); ++i)
    rows.logit_gradients[i] = io::Random(4, io::Stream::kInit, 1, i).Uniform() - 0.3f;
  return rows;
}

struct Result {
  std::vector<double> density, logits, gradients;
};

Result RunMlp(const Mlp& mlp, const MlpOptions& options, const Rows& rows) {
  std::vector<float> density, logits, gradients(WeightCount(options), 0.f);
  mlp.Differentiate(
      rows.n,
      rows.position.data(),
      rows.direction.data(),
      [&](const float* d, const float* c, float* d_gradient, float* c_gradient) {
        density.assign(d, d + rows.n);
        logits.assign(c, c + 3 * rows.n);
        std::copy(rows.density_gradients.begin(), rows.density_gradients.end(), d_gradient);
        std::copy(rows.logit_gradients.begin(), rows.logit_gradients.end(), c_gradient);
      },
      gradients.data());
  return {
      {density.begin(), density.end()}, {logits.begin(), logits.end()}, {gradients.begin(), gradients.end()}};
}

std::vector<double> CodeOf(const std::vector<float>& codes, int row, int inputs) {
  const auto begin = codes.begin() + row * CodeStride(inputs);
  return {begin, begin + inputs};
}

Reference::Row ReferenceRow(const Reference& reference,
                            const MlpOptions& options,
                            const Rows& rows,
                            int row) {
  return reference.Forward(CodeOf(rows.position, row, options.position_inputs),
                           CodeOf(rows.direction, row, options.direction_inputs));
}

Result RunReference(const Reference& reference, const MlpOptions& options, const Rows& rows) {
  Result result;
  result.gradients.assign(WeightCount(options), 0.0);
  for (int r = 0; r < rows.n; ++r) {
    const Reference::Row row = ReferenceRow(reference, options, rows, r);
    result.density.push_back(row.density);
    result.logits.insert(result.logits.end(), row.logits.begin(), row.logits.end());
    const auto at = static_cast<std::size_t>(r);
    const float* logit_gradients = &rows.logit_gradients[3 * at];
    reference.Backward(
        row, rows.density_gradients[at], {logit_gradients, logit_gradients + 3}, &result.gradients);
  }
  return result;
}

double RelativeL2(const double* a, const double* b, std::size_t n) {
  double error = 0, norm = 0;
  for (std::size_t i = 0; i < n; ++i) error += (a[i] - b[i]) * (a[i] - b[i]), norm += b[i] * b[i];
  return std::sqrt(error / norm);
}

double RelativeL2(const std::vector<double>& a, const std::vector<double>& b) {
  EXPECT_EQ(a.size(), b.size());
  return RelativeL2(a.data(), b.data(), a.size());
}

// The largest relative error of a weight matrix or bias vector.
double WorstTensor(const MlpOptions& options, const Result& a, const Result& b) {
  double worst = 0;
  for (const MlpLayer& layer : Layers(options)) {
    const double *x = a.gradients.data(), *y = b.gradients.data();
    worst =
        std::max({worst,
                  RelativeL2(x + layer.weights, y + layer.weights, layer.biases - layer.weights),
                  RelativeL2(x + layer.biases, y + layer.biases, static_cast<std::size_t>(layer.outputs))});
  }
  return worst;
}

// Small networks of every shape, and the full one.
MlpOptions Small(int position_inputs, int direction_inputs, int depth, int skip) {
  return {.position_inputs = position_inputs,
          .direction_inputs = direction_inputs,
          .depth = depth,
          .width = 32,
          .skip = skip,
          .colour_width = 16};
}

TEST(TorchMlp, OutputsAndGradientsAreThoseOfTheReferenceForEveryShape) {
  const MlpOptions full;
  // Codes with identity, without, none (p itself), and of exactly one aligned row; skip at either end or
  // none.
  const MlpOptions shapes[] = {full,
                               Small(63, 27, 8, 4),
                               Small(60, 24, 8, 4),
                               Small(3, 3, 8, 4),
                               Small(64, 32, 3, 0),
                               Small(63, 27, 4, 2),
                               Small(63, 27, 4, 4)};
  double worst_output = 0, worst_gradient = 0;
  for (const MlpOptions& options : shapes) {
    const std::vector<float> weights = InitialWeights(options, Initialisation::kUniform, 5);
    const auto mlp = MakeMlp(options);
    mlp->SetWeights(weights);
    for (const int n : {1, 15, 127, 128, 129, 1000}) {
      if (options.width == full.width && n > 129) continue;  // seconds in plain loops
      const Rows rows = MakeRows(options, n);
      const Result ours = RunMlp(*mlp, options, rows),
                   exact = RunReference(Reference(options, weights), options, rows);
      const double output =
          std::max(RelativeL2(ours.density, exact.density), RelativeL2(ours.logits, exact.logits));
      const double gradient = WorstTensor(options, ours, exact);
      EXPECT_LE(output, 1e-5) << options.position_inputs << " inputs, " << n << " rows";
      EXPECT_LE(gradient, 1e-5) << options.position_inputs << " inputs, " << n << " rows";
      worst_output = std::max(worst_output, output);
      worst_gradient = std::max(worst_gradient, gradient);
    }
  }
  std::printf("fp32: outputs %.1e, gradient of a tensor %.1e\n", worst_output, worst_gradient);
}

TEST(ReferenceMlp, GradientsAreCentralDifferences) {
  const MlpOptions options = Small(63, 27, 8, 4);
  Reference reference(options, InitialWeights(options, Initialisation::kUniform, 6));
  const Rows rows = MakeRows(options, 3);
  const std::vector<double> gradients = RunReference(reference, options, rows).gradients;
  const auto loss = [&] {
    const Result result = RunReference(reference, options, rows);
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i) sum += result.density[i] * rows.density_gradients[i];
    for (std::size_t i = 0; i < 9; ++i) sum += result.logits[i] * rows.logit_gradients[i];
    return sum;
  };
  constexpr double kStep = 1e-6;
  int checked = 0;
  for (const MlpLayer& layer : Layers(options)) {
    const std::size_t end = layer.biases + static_cast<std::size_t>(layer.outputs);
    for (std::size_t i = layer.weights; i < end; i += (end - layer.weights) / 7 + 1, ++checked) {
      const double old = reference.weights[i];
      reference.weights[i] = old + kStep;
      const double above = loss();
      reference.weights[i] = old - kStep;
      const double below = loss();
      reference.weights[i] = old;
      EXPECT_NEAR(gradients[i], (above - below) / (2 * kStep), 1e-8 + 1e-5 * std::fabs(gradients[i]))
          << layer.name << ", weight " << i;
    }
  }
  EXPECT_GE(checked, 12 * 5);
}

TEST(TorchMlp, TheDensityAloneIsThatOfTheFullQuery) {
  for (const bool bf16 : {false, true}) {
    const MlpOptions options{.bf16 = bf16};
    const auto mlp = MakeMlp(options);
    mlp->SetWeights(InitialWeights(options, Initialisation::kXavier, 1));
    const Rows rows = MakeRows(options, 129);
    std::vector<float> alone(129), full(129), logits(3 * 129);
    mlp->Query(129, rows.position.data(), nullptr, alone.data(), nullptr);
    mlp->Query(129, rows.position.data(), rows.direction.data(), full.data(), logits.data());
    EXPECT_EQ(alone, full);
    const Result trained = RunMlp(*mlp, options, rows);
    EXPECT_EQ(trained.density, std::vector<double>(full.begin(), full.end()));
    EXPECT_EQ(trained.logits, std::vector<double>(logits.begin(), logits.end()));
  }
}

TEST(TorchMlp, ThreeThreadsComputeTheBytesOfOne) {
  for (const bool bf16 : {false, true}) {
    const MlpOptions options{.bf16 = bf16};
    const auto mlp = MakeMlp(options);
    mlp->SetWeights(InitialWeights(options, Initialisation::kXavier, 1));
    const Rows rows = MakeRows(options, 300);
    const Result alone = RunMlp(*mlp, options, rows);
    Result side_by_side[3];
    std::vector<std::thread> threads;
    for (Result& result : side_by_side) threads.emplace_back([&] { result = RunMlp(*mlp, options, rows); });
    for (std::thread& thread : threads) thread.join();
    for (const Result& result : side_by_side) {
      EXPECT_EQ(result.density, alone.density);
      EXPECT_EQ(result.logits, alone.logits);
      EXPECT_TRUE(result.gradients == alone.gradients);
    }
  }
}

TEST(TorchMlp, GradientsAddToThoseThatAreThere) {
  const MlpOptions options = Small(63, 27, 8, 4);
  const auto mlp = MakeMlp(options);
  mlp->SetWeights(InitialWeights(options, Initialisation::kXavier, 1));
  const Rows rows = MakeRows(options, 5);
  const Result once = RunMlp(*mlp, options, rows);
  std::vector<float> twice(WeightCount(options), 0.f);
  for (int repeat = 0; repeat < 2; ++repeat) {
    mlp->Differentiate(
        rows.n,
        rows.position.data(),
        rows.direction.data(),
        [&](const float*, const float*, float* d_gradient, float* c_gradient) {
          std::copy(rows.density_gradients.begin(), rows.density_gradients.end(), d_gradient);
          std::copy(rows.logit_gradients.begin(), rows.logit_gradients.end(), c_gradient);
        },
        twice.data());
  }
  for (std::size_t i = 0; i < twice.size(); ++i) ASSERT_EQ(twice[i], 2 * once.gradients[i]);
}

// Eight bits of mantissa per product. Pre-activations that cross 0 by them make up most of the
// gradients' error; here, where every row has a gradient of its own, it does not average out as it does in a
// batch of rays (tests/nerf/fields/golden_test.cpp).
TEST(TorchMlp, Bf16StaysCloseToFloat) {
  const MlpOptions exact_options, options{.bf16 = true};
  const auto exact = MakeMlp(exact_options), mlp = MakeMlp(options);
  const std::vector<float> weights = InitialWeights(options, Initialisation::kXavier, 1);
  exact->SetWeights(weights);
  mlp->SetWeights(weights);
  const Rows rows = MakeRows(options, 1000);
  const Result a = RunMlp(*mlp, options, rows), b = RunMlp(*exact, exact_options, rows);
  const double output = std::max(RelativeL2(a.density, b.density), RelativeL2(a.logits, b.logits));
  const double gradient = WorstTensor(options, a, b);
  std::printf("bf16: outputs %.1e, gradient of a tensor %.1e\n", output, gradient);
  EXPECT_LE(output, 2e-2);
  EXPECT_LE(gradient, 0.2);
  EXPECT_GE(output, 1e-4) << "was it computed in float?";
}

// Neither ReLU nor the padding hides a NaN.
TEST(TorchMlp, ANaNInAnyLayerReachesTheOutputs) {
  for (const bool bf16 : {false, true}) {
    const MlpOptions options{.bf16 = bf16};
    const Rows rows = MakeRows(options, 3);
    const std::vector<MlpLayer> layers = Layers(options);
    for (std::size_t l = 0; l < layers.size(); ++l) {
      std::vector<float> weights = InitialWeights(options, Initialisation::kXavier, 1);
      weights[layers[l].weights] = std::numeric_limits<float>::quiet_NaN();
      const auto mlp = MakeMlp(options);
      mlp->SetWeights(weights);
      const Result result = RunMlp(*mlp, options, rows);
      const bool colour_only = l > 8;
      EXPECT_TRUE(std::isnan(result.logits[0]) || l == 8) << layers[l].name;
      EXPECT_EQ(std::isnan(result.density[0]), !colour_only) << layers[l].name;
    }
  }
}

TEST(Mlp, HasTheSizeOfThePapersNetwork) {
  EXPECT_EQ(MultiplyAdds({}), 593408);
  EXPECT_EQ(WeightCount({}), 595844u);
  EXPECT_EQ(Layers({}).size(), 12u);
}

TEST(Mlp, InitialWeightsFillTheirRange) {
  for (const Initialisation initialisation : {Initialisation::kXavier, Initialisation::kUniform}) {
    const std::vector<float> weights = InitialWeights({}, initialisation, 3);
    for (const MlpLayer& layer : Layers({})) {
      const bool xavier = initialisation == Initialisation::kXavier;
      const double limit =
          xavier ? std::sqrt(6. / (layer.inputs + layer.outputs)) : 1 / std::sqrt(layer.inputs);
      double largest = 0, sum = 0, squares = 0;
      const auto n = static_cast<double>(layer.biases - layer.weights);
      for (std::size_t i = layer.weights; i < layer.biases; ++i) {
        largest = std::max(largest, std::fabs(double{weights[i]}));
        sum += weights[i], squares += weights[i] * weights[i];
      }
      EXPECT_LE(largest, limit * (1 + 1e-6)) << layer.name;
      EXPECT_GE(largest, 0.97 * limit) << layer.name;
      EXPECT_LE(std::fabs(sum / n), 5 * limit / std::sqrt(3 * n)) << layer.name;
      EXPECT_NEAR(squares / n, limit * limit / 3, 0.2 * limit * limit / std::sqrt(n / 50)) << layer.name;
      for (std::size_t i = layer.biases; i < layer.biases + static_cast<std::size_t>(layer.outputs); ++i) {
        EXPECT_LE(std::fabs(weights[i]), limit) << layer.name;
        EXPECT_EQ(weights[i] == 0, xavier) << layer.name;
      }
    }
  }
  EXPECT_NE(InitialWeights({}, Initialisation::kXavier, 3), InitialWeights({}, Initialisation::kXavier, 4));
}

TEST(Mlp, CudaThatIsNotThereIsNamed) {
  if (TorchVersion().find("CUDA") != std::string::npos) GTEST_SKIP() << "this LibTorch has CUDA";
  EXPECT_ERROR(MakeMlp({.device = "cuda"}), io::ExitCode::kMissingTool, "--device cuda");
}

}  // namespace
}  // namespace nerf
