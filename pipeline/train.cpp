// `pipeline train`: the radiance field from the normalised scene.
#include <cmath>
#include <cstdio>

#include "io/error.h"
#include "io/transforms.h"
#include "nerf/trainer.h"
#include "pipeline/stage.h"
#include "pipeline/stages.h"

namespace pipeline {
namespace {

void TrainStage(int argc, const char* const* argv) {
  CommonOptions common;
  nerf::TrainOptions train;
  std::string field = "hash", time = "3m";
  Options options("pipeline train",
                  "Trains the radiance field of a run folder's normalised scene; Ctrl-C saves, the same "
                  "command continues.");
  AddCommonOptions(&options, &common);
  options.Add("field", &field, "radiance field: hash (multi-resolution hash grid)");
  options.Add("time", &time, "training budget: 30s, 3m, 1h; learning rate and sampling follow it");
  options.Add("steps", &train.steps, "train for exactly this many steps instead of --time; 0 = by time");
  options.Add("seed", &train.seed, "random seed; with --steps the same seed gives the same bytes");
  options.Add("batch", &train.samples_per_step, "samples per step");
  options.Add("learning-rate", &train.learning_rate, "first learning rate of Adam");
  options.Add("log2-hashmap-size",
              &train.field.log2_hashmap_size,
              "log2 of the entries of a hashed level; 0 = derived");
  options.Add(
      "finest-resolution", &train.field.finest_resolution, "cells per axis of the finest level; 0 = derived");
  options.Add("grid-resolution",
              &train.field.grid_resolution,
              "occupancy cells per axis, a multiple of 64; 0 = derived");
  options.Add("checkpoint-every", &train.checkpoint_every_s, "seconds between checkpoints", false);
  if (!options.Parse(argc, argv)) return;
  if (field != "hash")
    throw io::Error(io::ExitCode::kUsage, "--field: '" + field + "' is unknown", "The fields are: hash");
  train.time_s = ParseDuration("time", time);
  if (!(train.time_s > 0) || train.steps < 0 || train.samples_per_step < 1024 ||
      train.samples_per_step > 1 << 22 || !(train.learning_rate > 0) || train.field.log2_hashmap_size < 0 ||
      train.field.log2_hashmap_size > 24 || train.field.grid_resolution < 0 ||
      train.field.grid_resolution > 512 || train.field.grid_resolution % 64 != 0 ||
      train.field.finest_resolution < 0 || train.field.finest_resolution > 1 << 16) {
    throw io::Error(io::ExitCode::kUsage, "pipeline train: an option is out of range", "See --help");
  }
  train.threads = ResolvedThreads(common);

  const std::filesystem::path scene_folder = common.out / "scene";
  StageRun run("train", common, options, {scene_folder}, true);
  if (run.IsUpToDate()) return;
  const io::Scene scene = io::ReadTransforms(scene_folder / "transforms_train.json").scene;
  const std::filesystem::path heldout_path = scene_folder / "transforms_test.json";
  const io::Scene heldout =
      std::filesystem::exists(heldout_path) ? io::ReadTransforms(heldout_path).scene : io::Scene{};

  const nerf::TrainReport report = nerf::Train(scene, heldout, train, run.folder());
  if (!report.derivation.empty()) run.Decide(report.derivation);
  for (const std::string& event : report.events) run.Decide(event);
  char line[200];
  std::snprintf(line,
                sizeof line,
                "%llu steps in %.1f s with %s kernels: %.2f M samples/s, %.1f samples per ray, %.1f %% of "
                "the space occupied",
                static_cast<unsigned long long>(report.steps),
                report.train_s,
                report.kernels.c_str(),
                report.samples_per_s / 1e6,
                report.samples_per_ray,
                100 * report.occupied_share);
  run.Decide(line);
  run.Set("field", field);
  run.Set("parameters", static_cast<double>(report.parameters));
  run.Set("steps", static_cast<double>(report.steps));
  run.Set("train_s", report.train_s);
  run.Set("samples_per_s", report.samples_per_s);
  run.Set("rays_per_s", report.rays_per_s);
  run.Set("samples_per_ray", report.samples_per_ray);
  if (std::isfinite(report.heldout_psnr)) run.Set("monitored_heldout_psnr", report.heldout_psnr);
  run.Set("skipped_steps", report.skipped_steps);
  run.Set("restarts", report.restarts);
  run.Finish();
}

}  // namespace

int RunTrain(int argc, const char* const* argv) {
  return GuardedMain("pipeline train", [&] { TrainStage(argc, argv); });
}

}  // namespace pipeline
