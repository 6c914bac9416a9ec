// Training of the `nerf` field when it goes wrong: values that are not finite, and starts that never come
// alive.
#include <cstring>
#include <limits>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "nerf/steps/field_training.h"
#include "nerf/training/heldout_monitor.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/field_tensor.h"
#include "tests/support/scenes/small_mlp.h"

namespace nerf {
namespace {

using tests::FieldOf;
using tests::kStratifiedFar;
using tests::SmallBall;
using tests::SmallMlp;
using tests::TensorOf;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(),
                kInfinity = std::numeric_limits<float>::infinity();
constexpr std::size_t kDensityLayer = 8;
// Seeds of the start on white; NERF_TEST_SEEDS=20 tries as many as the figure in nerf/EXPERIMENTS.md.
std::uint64_t Seeds() {
  const char* text = std::getenv("NERF_TEST_SEEDS");
  return text ? std::stoull(text) : 4;
}

// A training that can be driven step by step.
struct Bench {
  explicit Bench(const io::Scene& scene, const TrainOptions& train_options, std::uint64_t seed = 1)
      : options(train_options), dataset(LoadDataset(scene, 1)) {
    std::string derivation;
    state.seed = seed;
    scene_field = MakeSceneField(scene, dataset, options.field, seed, &workers, &derivation);
    training = MakeMlpTraining(dataset, options, scene_field.get(), &workers);
  }
  std::span<float> Weights() { return TensorOf(scene_field->field.get(), "weights"); }
  // All values of the field's state, as bytes, so that NaNs compare.
  std::string StateBytes() {
    std::string bytes;
    for (const Tensor& tensor : FieldOf(scene_field.get()).State())
      bytes.append(reinterpret_cast<const char*>(tensor.values.data()), tensor.values.size_bytes());
    return bytes;
  }
  StepOutcome Step() {
    const StepOutcome outcome = training->Step(0, &state);
    ++state.step;
    return outcome;
  }

  TrainOptions options;
  Dataset dataset;
  io::Workers workers{2};
  TrainState state;
  std::unique_ptr<SceneField> scene_field;
  std::unique_ptr<FieldTraining> training;
};

MlpLayer LayerOf(const TrainOptions& options, std::size_t layer) {
  return Layers(MlpOptionsOf(options.field.mlp))[layer];
}

TEST(MlpFaults, ANaNInAnyLayerIsFoundInTheSameStepWhichIsNotApplied) {
  const TempDir dir;
  const io::Scene scene = SmallBall(dir.path(), 4, 0, kStratifiedFar);
  for (const QuadratureOptions quadrature :
       {QuadratureOptions{}, {.n_samples = 8}, {.n_samples = 8, .n_importance = 8}}) {
    Bench bench(scene, SmallMlp(100, 64, quadrature));
    EXPECT_EQ(bench.Step().fault, "");
    for (const std::size_t layer : {std::size_t{0}, std::size_t{11}}) {
      // In the second network, where there is one.
      const std::size_t first = FieldOf(bench.scene_field.get()).n_parameters() -
                                FieldOf(bench.scene_field.get()).weights_per_network();
      float& weight = bench.Weights()[first + LayerOf(bench.options, layer).weights];
      const float healthy = weight;
      weight = kNaN;
      bench.scene_field->field->Refresh();
      const std::string before = bench.StateBytes();
      EXPECT_NE(bench.Step().fault.find("loss of ray "), std::string::npos) << "layer " << layer;
      EXPECT_TRUE(bench.StateBytes() == before) << "layer " << layer;
      weight = healthy;
      bench.scene_field->field->Refresh();
      EXPECT_EQ(bench.Step().fault, "");
    }
  }
}

// A loss may be finite where its gradient is not. Here a ReLU hides -inf, and 0 * inf appears on the way
// back.
TEST(MlpFaults, AGradientThatIsNotFiniteNamesItsLayer) {
  const TempDir dir;
  const io::Scene scene = SmallBall(dir.path(), 4, 0, kStratifiedFar);
  Bench bench(scene, SmallMlp(100, 32, {.n_samples = 8}));
  bench.Weights()[LayerOf(bench.options, 0).biases] = 100;          // unit 0 is on for every sample ...
  bench.Weights()[LayerOf(bench.options, 1).weights] = -kInfinity;  // ... and turns unit 0 of layer 1 off
  bench.scene_field->field->Refresh();
  const std::string before = bench.StateBytes();
  EXPECT_EQ(bench.Step().fault, "gradient of layer 0 (trunk)");
  EXPECT_TRUE(bench.StateBytes() == before);
}

// Changes the weights of the checkpoint in `folder`.
template <typename Change>
void Poison(const std::filesystem::path& folder, const Change& change) {
  TrainState state;
  const auto scene_field = ReadCheckpoint(folder / "checkpoint.bin", &state);
  change(TensorOf(scene_field->field.get(), "weights"), &state);
  WriteCheckpoint(folder / "checkpoint.bin", scene_field.get(), state);
}

TEST(MlpFaults, TrainingGivesUpAfterThreeSkippedStepsAndLeavesTheCheckpointAlone) {
  const TempDir dir;
  const io::Scene scene = SmallBall(dir.path(), 4, 0, kStratifiedFar);
  const TrainOptions options = SmallMlp(20, 32, {.n_samples = 8});
  Train(scene, {}, SmallMlp(3, 32, {.n_samples = 8}), dir.path());
  Poison(dir.path(),
         [&](std::span<float> weights, TrainState*) { weights[LayerOf(options, 0).weights] = kNaN; });
  const std::string before = io::ReadFile(dir / "checkpoint.bin");
  EXPECT_ERROR(Train(scene, {}, options, dir.path()), io::ExitCode::kNumeric, "step 6, seed 1");
  EXPECT_EQ(io::ReadFile(dir / "checkpoint.bin"), before);
}

// The density's bias holds every ReLU density at 0, where no gradient moves it.
TEST(MlpFaults, ADeadStartIsRestartedOnceByStep500) {
  const TempDir dir;
  const io::Scene scene = SmallBall(dir.path(), 4, 0, kStratifiedFar);
  const auto options = [](int steps) {
    TrainOptions result = SmallMlp(steps, 1, {.n_samples = 8});
    result.field.mlp.density = DensityActivation::kRelu;
    return result;
  };
  Train(scene, {}, options(1), dir.path());
  Poison(dir.path(), [&](std::span<float> weights, TrainState* state) {
    weights[LayerOf(options(1), kDensityLayer).biases] = -1e3f;
    state->step = 495;
    state->squared_error = -1;
  });
  const TrainReport report = Train(scene, {}, options(501), dir.path());
  EXPECT_EQ(report.restarts, 1);
  EXPECT_EQ(report.steps, 501u);
  ASSERT_EQ(report.events.size(), 2u);  // resumed, restarted
  EXPECT_EQ(report.events[1], "collapsed by step 500 with seed 1; restarted with the next seed");
}

// The steps until training is 5 dB above the constant picture, at most 300, on pictures that are 90 % white.
int StepsToFiveDb(const io::Scene& scene, const TrainOptions& options, std::uint64_t seed) {
  Bench bench(scene, options, seed);
  const double constant = ConstantSquaredError(bench.dataset, 1.0);
  double mean = constant;
  int step = 0;
  while (step < 300 && mean > constant * std::pow(10, -0.5)) {
    const StepOutcome outcome = bench.Step();
    EXPECT_EQ(outcome.fault, "");
    mean = 0.95 * mean + 0.05 * outcome.squared_error;
    ++step;
  }
  return step;
}

TEST(MlpFaults, EverySeedComesAliveOnASceneThatIsMostlyWhite) {
  const TempDir dir;
  io::Scene scene = tests::BallScene(dir.path(), 12, 0, {.size = 24, .focal = 0.875});
  scene.near = 3;
  scene.far = 5;
  TrainOptions options = SmallMlp(300, 64, {.n_samples = 8});
  options.learning_rate = 0;  // the field's own, with its warm-up
  options.mlp.learning_rate_warm_up = MlpTrainOptions().learning_rate_warm_up;
  options.mlp.white_background = true;
  for (std::uint64_t seed = 1; seed <= Seeds(); ++seed) {
    const int steps = StepsToFiveDb(scene, options, seed);
    std::printf("softplus, seed %d: 5 dB after %d steps\n", static_cast<int>(seed), steps);
    EXPECT_LT(steps, 300) << "seed " << seed;
  }
}

}  // namespace
}  // namespace nerf
