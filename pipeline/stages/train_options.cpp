#include "pipeline/stages/train_options.h"

#include "io/base/error.h"
#include "nerf/kernels/kernels.h"

namespace pipeline {
namespace {

// Limits beyond which a value can only be a slip.
constexpr int kMaxSamples = 1 << 14, kMaxRays = 1 << 20, kMaxFrequencies = 20, kMaxBatch = 1 << 22;
constexpr int kMinBatch = 1024;

constexpr double kTargetCeiling_s = 3600;

void Require(bool holds, const std::string& text) {
  if (!holds) throw io::Error(io::ExitCode::kUsage, text, "See --help");
}

void SetPrecision(const std::string& precision, nerf::SceneFieldOptions* field) {
  const bool is_half = precision == "bf16-table" || precision == "bf16-network";
  if (field->kind == nerf::FieldKind::kHash) {
    const bool both = precision == "bf16" || (precision == "auto" && nerf::kernels::HasBf16Products());
    field->bf16_table = both || precision == "bf16-table";
    field->bf16_network = both || precision == "bf16-network";
  } else {
    Require(!is_half, "--precision: '" + precision + "' needs --field hash");
    field->mlp.bf16 = precision == "auto" ? nerf::PrefersBf16(field->mlp.device) : precision == "bf16";
  }
}

// What one option demands of another.
void CheckTogether(const nerf::TrainOptions& train) {
  const nerf::MlpFieldOptions& mlp = train.field.mlp;
  const nerf::QuadratureOptions& quadrature = mlp.quadrature;
  Require(quadrature.n_samples > 0 || (quadrature.n_importance == 0 && !quadrature.open_end),
          "--importance-samples and --open-end need --samples");
  Require(mlp.position.identity || mlp.position.frequencies > 0,
          "--no-encoding-identity: without frequencies nothing is left of the position");
  // Positions in scene units need samples that are placed in them.
  Require(!mlp.scene_units || quadrature.n_samples > 0, "--encoding-space scene needs --samples");
}

}  // namespace

void AddTrainOptions(Options* options, TrainFlags* flags) {
  nerf::TrainOptions& train = flags->train;
  nerf::MlpFieldOptions& mlp = train.field.mlp;
  options->Add("field",
               &flags->field,
               "radiance field: hash (grid, own kernels) or nerf (the original MLP, LibTorch)",
               {.choices = {"hash", "nerf"}});
  options->Add("preset",
               &flags->preset,
               "report: every value as in the report on the original NeRF; implies --field nerf",
               {.choices = {"report"}});
  options->Add("time",
               &flags->time,
               "training budget: 30s, 3m, 1h; learning rate and sampling follow it",
               {.check = ParseDuration});
  options->Add(
      "target",
      &flags->target,
      "hash: train until validation views reach this PSNR, as 30dB; --time is then the ceiling, one hour "
      "if not given",
      {.check = ParseDecibels});
  options->Add(
      "steps", &train.steps, "train for exactly this many steps instead of --time; 0 = by time", {.min = 0});
  options->Add("seed", &train.seed, "random seed; with --steps the same seed gives the same bytes");
  options->Add("batch",
               &flags->batch,
               "samples per step, 1024 or more; 0 = the field's own",
               {.min = 0, .max = kMaxBatch});
  options->Add("refine-cameras",
               &train.refine_cameras,
               "hash, photographs: move the poses that their own pictures pull at");
  options->Add(
      "find-transients",
      &train.find_transients,
      "hash, photographs: leave out what one picture shows and the others do not, such as passers-by");
  options->Add("splats",
               &train.splats,
               "hash, photographs: fit Gaussian splats in the second half of the budget, and mix them into "
               "every picture");
  options->Add(
      "learning-rate", &train.learning_rate, "first learning rate of Adam; 0 = the field's own", {.min = 0});
  options->Add("log2-hashmap-size",
               &train.field.log2_hashmap_size,
               "hash: log2 of the entries of a hashed level; 0 = derived",
               {.min = 0, .max = 24});
  options->Add("finest-resolution",
               &train.field.finest_resolution,
               "hash: cells per axis of the finest level; 0 = derived",
               {.min = 0, .max = 1 << 16});
  options->Add("grid-resolution",
               &train.field.grid_resolution,
               "occupancy cells per axis, a multiple of 64 up to 512; 0 = derived",
               {.choices = {"0", "64", "128", "192", "256", "320", "384", "448", "512"}});
  options->Add("samples",
               &mlp.quadrature.n_samples,
               "nerf: stratified samples per ray on [near, far]; 0 = where the occupancy grid says",
               {.min = 0, .max = kMaxSamples});
  options->Add("importance-samples",
               &mlp.quadrature.n_importance,
               "nerf: further samples where a first network saw weight",
               {.min = 0, .max = kMaxSamples});
  options->Add(
      "open-end", &mlp.quadrature.open_end, "nerf: the last interval is 1e10 long, as in the original code");
  options->Add(
      "rays", &train.mlp.rays, "nerf: rays per step, drawn over all pictures", {.min = 1, .max = kMaxRays});
  options->Add("learning-rate-decay",
               &train.mlp.learning_rate_final,
               "nerf: last learning rate as a share of the first; 1 = constant",
               {.max = 1, .above = 0});
  options->Add("learning-rate-warm-up",
               &train.mlp.learning_rate_warm_up,
               "nerf: steps over which the learning rate rises from 0",
               {.min = 0});
  options->Add("white-background",
               &train.mlp.white_background,
               "nerf: pictures with alpha on white only, not on all backgrounds");
  options->Add("positional-encoding",
               &flags->positional_encoding,
               "nerf: encode positions and directions; --no-positional-encoding is the ablation");
  options->Add("position-frequencies",
               &mlp.position.frequencies,
               "nerf: frequencies of the position's encoding",
               {.min = 0, .max = kMaxFrequencies});
  options->Add("direction-frequencies",
               &mlp.direction.frequencies,
               "nerf: frequencies of the direction's encoding",
               {.min = 0, .max = kMaxFrequencies});
  options->Add("encoding-identity", &flags->identity, "nerf: codes begin with the coordinates themselves");
  options->Add("encoding-space",
               &flags->encoding_space,
               "nerf: cube (pi 2^k, the scene fills [-1, 1]) or scene (2^k, scene units)",
               {.choices = {"cube", "scene"}});
  options->Add("density",
               &flags->density,
               "nerf: density activation: softplus, relu or exp",
               {.choices = {"softplus", "relu", "exp"}});
  options->Add("initialisation",
               &flags->initialisation,
               "nerf: xavier, or uniform as LibTorch's own",
               {.choices = {"xavier", "uniform"}});
  options->Add("pixel-centres",
               &mlp.pixel_centres,
               "nerf: rays through pixel centres; --no-pixel-centres: corners, as the original code");
  options->Add("precision",
               &flags->precision,
               "factors of the networks' products: bf16 (sums and weights in float), fp32, or auto; hash has "
               "bf16-network and bf16-table alone as well",
               {.choices = {"auto", "fp32", "bf16", "bf16-table", "bf16-network"}});
  options->Add("device",
               &mlp.device,
               "nerf: cpu, or cuda where the linked LibTorch has it",
               {.choices = {"cpu", "cuda"}});
  options->Add("checkpoint-every",
               &train.checkpoint_every_s,
               "seconds between checkpoints",
               {.min = 0, .affects_result = false});
}

nerf::TrainOptions ResolvedTrainOptions(const Options& options, const TrainFlags& flags) {
  nerf::TrainOptions train = flags.train;
  const nerf::FieldKind kind = *nerf::FieldKindOf(flags.field);  // one of the choices
  train.field.kind = kind;
  train.time_s = ParseDuration("time", flags.time);
  if (options.IsSetByUser("time") && !options.IsSetByUser("steps")) train.steps = 0;
  if (!flags.target.empty()) {
    train.target_psnr = ParseDecibels("target", flags.target);
    Require(kind == nerf::FieldKind::kHash, "--target: needs --field hash");
    Require(train.steps == 0, "--target: does not go with --steps");
    if (!options.IsSetByUser("time")) train.time_s = kTargetCeiling_s;
  }
  if (flags.batch != 0) {
    Require(flags.batch >= kMinBatch, "--batch: must be 0 or at least 1024");
    train.samples_per_step = train.mlp.samples_per_step = flags.batch;
  }
  nerf::MlpFieldOptions& mlp = train.field.mlp;
  mlp.scene_units = flags.encoding_space == "scene";
  mlp.position.times_pi = !mlp.scene_units;
  mlp.position.identity = mlp.direction.identity = flags.identity;
  if (!flags.positional_encoding) {
    mlp.position.frequencies = mlp.direction.frequencies = 0;
    mlp.position.identity = mlp.direction.identity = true;
  }
  mlp.density = flags.density == "softplus" ? nerf::DensityActivation::kSoftplus
                : flags.density == "relu"   ? nerf::DensityActivation::kRelu
                                            : nerf::DensityActivation::kExp;
  mlp.initialisation =
      flags.initialisation == "xavier" ? nerf::Initialisation::kXavier : nerf::Initialisation::kUniform;
  SetPrecision(flags.precision, &train.field);
  CheckTogether(train);
  return train;
}

}  // namespace pipeline
