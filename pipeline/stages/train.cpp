// `pipeline train`: the radiance field from the normalised scene.
#include <fmt/format.h>

#include <cmath>

#include "io/base/error.h"
#include "io/scene/transforms.h"
#include "nerf/training/target_training.h"
#include "pipeline/evaluation/heldout_split.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_run.h"
#include "pipeline/stages/moved_cameras.h"
#include "pipeline/stages/rank_session.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/torch_program.h"
#include "pipeline/stages/train_options.h"
#include "pipeline/stages/train_preset.h"
#include "pipeline/stages/trained_scene.h"
#include "pipeline/stages/training_watch.h"

namespace pipeline {
namespace {

// A target is measured on validation pictures, since test views decide nothing: those of a given split, or
// one in so many of the training pictures, which are then not trained on.
constexpr int kValidationEvery = 10;

io::Scene SceneOf(const std::filesystem::path& json) {
  return std::filesystem::exists(json) ? io::ReadTransforms(json).scene : io::Scene{};
}

// The pictures that training is watched on.
io::Scene MonitoredScene(const std::filesystem::path& scene_folder,
                         bool decides,
                         io::Scene* train,
                         StageRun* run) {
  if (!decides) return SceneOf(scene_folder / "transforms_test.json");
  io::Scene given = SceneOf(scene_folder / "transforms_val.json");
  if (!given.frames.empty()) return given;
  io::Scene aside = SetAside(kValidationEvery, train);
  run->Decide(fmt::format("the target is measured on {} of {} training pictures, which are set aside",
                          aside.frames.size(),
                          aside.frames.size() + train->frames.size()));
  return aside;
}

void TrainStage(int argc, const char* const* argv) {
  CommonOptions common;
  TrainFlags flags;
  Options options("pipeline train",
                  "Trains the radiance field of a run folder's normalised scene; Ctrl-C saves, the same "
                  "command continues.");
  AddCommonOptions(&options, &common);
  AddTrainOptions(&options, &flags);
  if (!options.Parse(argc, argv)) return;
  ApplyPreset(argc, argv, &options, &flags);
  const RankSession session("train", common.out, argc, argv);
  nerf::TrainOptions train = ResolvedTrainOptions(options, flags);
  train.threads = ResolvedThreads(common);
  train.memory = ResolvedMemory(common);
  if (train.field.kind == nerf::FieldKind::kMlp) {
    if (io::AllRanks().AreSeveral())
      throw io::Error(
          io::ExitCode::kUsage, "--field nerf trains on one rank", "Unset WORLD_SIZE, or use --field hash");
    ContinueWithTorch("train", argc, argv);
  }

  const std::filesystem::path scene_folder = common.out / "scene";
  StageRun run("train", common, options, {scene_folder}, true);
  if (run.IsUpToDate()) return;
  io::Scene scene = io::ReadTransforms(scene_folder / "transforms_train.json").scene;
  const io::Scene monitored = MonitoredScene(scene_folder, train.target_psnr > 0, &scene, &run);
  if (run.Leads()) train.watcher = WatcherOf(common.out);
  const auto train_field = train.target_psnr > 0 ? nerf::TrainToTarget : nerf::Train;
  const nerf::TrainReport report = train_field(scene, monitored, train, run.folder());
  if (!run.Leads()) return;
  WriteMovedCameras(run.folder() / "cameras.json", report.moved_cameras);
  std::filesystem::remove_all(run.folder() / "masks");
  std::filesystem::create_directory(run.folder() / "masks");
  for (std::size_t i = 0; i < report.masks.size(); ++i) {
    if (!report.masks[i].used.empty())
      io::WriteMask(TrainingMaskPath(run.folder(), scene.frames[i]), report.masks[i]);
  }
  if (!report.derivation.empty()) run.Decide(report.derivation);
  for (const std::string& event : report.events) run.Decide(event);
  run.Decide(
      fmt::format("{} steps in {:.1f} s with {}: {:.3f} M samples/s, {:.1f} samples per ray, {:.1f} % of the "
                  "space occupied",
                  report.steps,
                  report.train_s,
                  report.arithmetic,
                  report.samples_per_s / 1e6,
                  report.samples_per_ray,
                  100 * report.occupied_share));
  if (report.gemm_gflops > 0) {
    run.Decide(
        fmt::format("network arithmetic {:.0f} GFLOP/s, {:.0f} % of the {:.0f} that plain matrix products of "
                    "its size reach here",
                    report.gflops,
                    100 * report.gflops / report.gemm_gflops,
                    report.gemm_gflops));
    run.Set("gflops", report.gflops);
    run.Set("gemm_gflops", report.gemm_gflops);
  }
  run.Set("field", nerf::NameOf(train.field.kind));
  run.Set("parameters", static_cast<double>(report.parameters));
  run.Set("steps", static_cast<double>(report.steps));
  run.Set("train_s", report.train_s);
  run.Set("samples_per_s", report.samples_per_s);
  run.Set("rays_per_s", report.rays_per_s);
  run.Set("samples_per_ray", report.samples_per_ray);
  if (std::isfinite(report.heldout_psnr)) run.Set("monitored_heldout_psnr", report.heldout_psnr);
  run.Set("moved_cameras", static_cast<double>(report.moved_cameras.size()));
  run.Set("skipped_steps", report.skipped_steps);
  run.Set("restarts", report.restarts);
  run.Finish();
}

}  // namespace

int RunTrain(int argc, const char* const* argv) {
  return GuardedMain("pipeline train", [&] { TrainStage(argc, argv); });
}

}  // namespace pipeline
