#include "pipeline/stages/train_options.h"

#include "io/base/error.h"
#include "nerf/kernels/kernels.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;

// Limits beyond which a value can only be a slip.
constexpr int kMaxSamples = 1 << 14, kMaxRays = 1 << 20, kMaxFrequencies = 20, kMaxBatch = 1 << 22;

constexpr double kTargetCeiling_s = 3600;

[[noreturn]] void Unknown(const std::string& option, const std::string& value, const std::string& known) {
  throw Error(ExitCode::kUsage, "--" + option + ": '" + value + "' is unknown", "Known: " + known);
}

bool Choose(const std::string& option, const std::string& value, const char* first, const char* second) {
  if (value != first && value != second) Unknown(option, value, std::string(first) + ", " + second);
  return value == first;
}

nerf::DensityActivation DensityOf(const std::string& name) {
  if (name == "softplus") return nerf::DensityActivation::kSoftplus;
  if (name == "relu") return nerf::DensityActivation::kRelu;
  if (name == "exp") return nerf::DensityActivation::kExp;
  Unknown("density", name, "softplus, relu, exp");
}

void Require(bool holds, const std::string& text) {
  if (!holds) throw Error(ExitCode::kUsage, text, "See --help");
}

void SetHashPrecision(const std::string& precision, nerf::SceneFieldOptions* field) {
  const bool both = precision == "bf16" || (precision == "auto" && nerf::kernels::HasBf16Products());
  if (!both && precision != "auto" && precision != "fp32" && precision != "bf16-table" &&
      precision != "bf16-network") {
    Unknown("precision", precision, "auto, fp32, bf16, bf16-table, bf16-network");
  }
  field->bf16_table = both || precision == "bf16-table";
  field->bf16_network = both || precision == "bf16-network";
}

void CheckRanges(const nerf::TrainOptions& train) {
  const nerf::SceneFieldOptions& field = train.field;
  const nerf::QuadratureOptions& quadrature = field.mlp.quadrature;
  Require(train.time_s > 0, "--time: must be positive");
  Require(train.steps >= 0, "--steps: must not be negative");
  Require(train.samples_per_step >= 1024 && train.samples_per_step <= kMaxBatch,
          "--batch: must lie in 1024 to 4194304");
  Require(train.learning_rate >= 0, "--learning-rate: must not be negative");
  Require(field.log2_hashmap_size >= 0 && field.log2_hashmap_size <= 24,
          "--log2-hashmap-size: must lie in 0 to 24");
  Require(field.finest_resolution >= 0 && field.finest_resolution <= 1 << 16,
          "--finest-resolution: must lie in 0 to 65536");
  Require(field.grid_resolution >= 0 && field.grid_resolution <= 512 && field.grid_resolution % 64 == 0,
          "--grid-resolution: must be a multiple of 64 up to 512");
  Require(quadrature.n_samples >= 0 && quadrature.n_samples <= kMaxSamples,
          "--samples: must lie in 0 to 16384");
  Require(quadrature.n_importance >= 0 && quadrature.n_importance <= kMaxSamples,
          "--importance-samples: must lie in 0 to 16384");
  Require(quadrature.n_samples > 0 || (quadrature.n_importance == 0 && !quadrature.open_end),
          "--importance-samples and --open-end need --samples");
  Require(train.mlp.rays >= 1 && train.mlp.rays <= kMaxRays, "--rays: must lie in 1 to 1048576");
  Require(train.mlp.learning_rate_final > 0 && train.mlp.learning_rate_final <= 1,
          "--learning-rate-decay: must lie in 0 to 1");
  Require(train.mlp.learning_rate_warm_up >= 0, "--learning-rate-warm-up: must not be negative");
  for (const int frequencies : {field.mlp.position.frequencies, field.mlp.direction.frequencies})
    Require(frequencies >= 0 && frequencies <= kMaxFrequencies, "frequencies must lie in 0 to 20");
  Require(field.mlp.position.identity || field.mlp.position.frequencies > 0,
          "--no-encoding-identity: without frequencies nothing is left of the position");
}

}  // namespace

void AddTrainOptions(Options* options, TrainFlags* flags) {
  nerf::TrainOptions& train = flags->train;
  nerf::MlpFieldOptions& mlp = train.field.mlp;
  options->Add("field",
               &flags->field,
               "radiance field: hash (grid, own kernels) or nerf (the original MLP, LibTorch)");
  options->Add("preset",
               &flags->preset,
               "report: every value as in the report on the original NeRF; implies --field nerf");
  options->Add("time", &flags->time, "training budget: 30s, 3m, 1h; learning rate and sampling follow it");
  options->Add(
      "target",
      &flags->target,
      "hash: train until held-out views reach this PSNR, as 30dB; --time is then the ceiling, one hour "
      "if not given");
  options->Add("steps", &train.steps, "train for exactly this many steps instead of --time; 0 = by time");
  options->Add("seed", &train.seed, "random seed; with --steps the same seed gives the same bytes");
  options->Add("batch", &flags->batch, "samples per step; 0 = the field's own");
  options->Add("learning-rate", &train.learning_rate, "first learning rate of Adam; 0 = the field's own");
  options->Add("log2-hashmap-size",
               &train.field.log2_hashmap_size,
               "hash: log2 of the entries of a hashed level; 0 = derived");
  options->Add("finest-resolution",
               &train.field.finest_resolution,
               "hash: cells per axis of the finest level; 0 = derived");
  options->Add("grid-resolution",
               &train.field.grid_resolution,
               "occupancy cells per axis, a multiple of 64; 0 = derived");
  options->Add("samples",
               &mlp.quadrature.n_samples,
               "nerf: stratified samples per ray on [near, far]; 0 = where the occupancy grid says");
  options->Add("importance-samples",
               &mlp.quadrature.n_importance,
               "nerf: further samples where a first network saw weight");
  options->Add(
      "open-end", &mlp.quadrature.open_end, "nerf: the last interval is 1e10 long, as in the original code");
  options->Add("rays", &train.mlp.rays, "nerf: rays per step, drawn over all pictures");
  options->Add("learning-rate-decay",
               &train.mlp.learning_rate_final,
               "nerf: last learning rate as a share of the first; 1 = constant");
  options->Add("learning-rate-warm-up",
               &train.mlp.learning_rate_warm_up,
               "nerf: steps over which the learning rate rises from 0");
  options->Add("white-background",
               &train.mlp.white_background,
               "nerf: pictures with alpha on white only, not on all backgrounds");
  options->Add("positional-encoding",
               &flags->positional_encoding,
               "nerf: encode positions and directions; --no-positional-encoding is the ablation");
  options->Add(
      "position-frequencies", &mlp.position.frequencies, "nerf: frequencies of the position's encoding");
  options->Add(
      "direction-frequencies", &mlp.direction.frequencies, "nerf: frequencies of the direction's encoding");
  options->Add("encoding-identity", &flags->identity, "nerf: codes begin with the coordinates themselves");
  options->Add("encoding-space",
               &flags->encoding_space,
               "nerf: cube (pi 2^k, the scene fills [-1, 1]) or scene (2^k, scene units)");
  options->Add("density", &flags->density, "nerf: density activation: softplus, relu or exp");
  options->Add("initialisation", &flags->initialisation, "nerf: xavier, or uniform as LibTorch's own");
  options->Add("pixel-centres",
               &mlp.pixel_centres,
               "nerf: rays through pixel centres; --no-pixel-centres: corners, as the original code");
  options->Add("precision",
               &flags->precision,
               "factors of the networks' products: bf16 (sums and weights in float), fp32, or auto; hash has "
               "bf16-network and bf16-table alone as well");
  options->Add("device", &mlp.device, "nerf: cpu, or cuda where the linked LibTorch has it");
  options->Add("checkpoint-every", &train.checkpoint_every_s, "seconds between checkpoints", false);
}

void ApplyPreset(int argc, const char* const* argv, Options* options, TrainFlags* flags) {
  if (flags->preset.empty()) return;
  if (flags->preset != "report") Unknown("preset", flags->preset, "report");
  options->ApplyPreset(argc, argv, [flags] {
    flags->train = nerf::ReportTrainOptions();
    flags->field = "nerf";
    flags->density = "relu";
    flags->initialisation = "uniform";
    flags->encoding_space = "scene";
    flags->precision = "bf16";
    flags->positional_encoding = flags->identity = true;
  });
}

nerf::TrainOptions ResolvedTrainOptions(const Options& options, const TrainFlags& flags) {
  nerf::TrainOptions train = flags.train;
  const auto kind = nerf::FieldKindOf(flags.field);
  if (!kind) Unknown("field", flags.field, "hash, nerf");
  train.field.kind = *kind;
  train.time_s = ParseDuration("time", flags.time);
  if (options.IsSetByUser("time") && !options.IsSetByUser("steps")) train.steps = 0;
  if (!flags.target.empty()) {
    train.target_psnr = ParseDecibels("target", flags.target);
    Require(kind == nerf::FieldKind::kHash, "--target: needs --field hash");
    Require(train.steps == 0, "--target: does not go with --steps");
    if (!options.IsSetByUser("time")) train.time_s = kTargetCeiling_s;
  }
  if (flags.batch != 0) train.samples_per_step = train.mlp.samples_per_step = flags.batch;
  nerf::MlpFieldOptions& mlp = train.field.mlp;
  const bool cube = Choose("encoding-space", flags.encoding_space, "cube", "scene");
  mlp.scene_units = !cube;
  mlp.position.times_pi = cube;
  mlp.position.identity = mlp.direction.identity = flags.identity;
  if (!flags.positional_encoding) {
    mlp.position.frequencies = mlp.direction.frequencies = 0;
    mlp.position.identity = mlp.direction.identity = true;
  }
  mlp.density = DensityOf(flags.density);
  mlp.initialisation = Choose("initialisation", flags.initialisation, "xavier", "uniform")
                           ? nerf::Initialisation::kXavier
                           : nerf::Initialisation::kUniform;
  Choose("device", mlp.device, "cpu", "cuda");
  if (kind == nerf::FieldKind::kHash) {
    SetHashPrecision(flags.precision, &train.field);
  } else {
    mlp.bf16 = flags.precision == "auto" ? nerf::PrefersBf16(mlp.device)
                                         : Choose("precision", flags.precision, "bf16", "fp32");
  }
  // Positions in scene units need samples that are placed in them.
  Require(cube || mlp.quadrature.n_samples > 0, "--encoding-space scene needs --samples");
  CheckRanges(train);
  return train;
}

}  // namespace pipeline
