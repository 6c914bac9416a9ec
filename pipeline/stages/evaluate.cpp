#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "io/scene/transforms.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/run_record.h"
#include "pipeline/stage/stage_run.h"
#include "pipeline/stages/evaluation.h"
#include "pipeline/stages/stage_options.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/torch_program.h"

namespace pipeline {
namespace {

using Json = nlohmann::ordered_json;

// The name of the protocol that `normalize` chose when it split the pictures.
std::string ProtocolName(const std::filesystem::path& run_folder) {
  const Json record = ReadStageRecord(run_folder, "normalize");
  return record.is_object() ? record.value("protocol", "capture") : "capture";
}

void Evaluate(const CommonOptions& common, const EvaluationOptions& options, const Options& bound) {
  const std::filesystem::path scene_folder = common.out / "scene",
                              checkpoint = common.out / "train/checkpoint.bin";
  StageRun stage("evaluate", common, bound, {scene_folder, checkpoint}, true);
  if (stage.IsUpToDate()) return;
  io::Scene test = io::ReadTransforms(scene_folder / "transforms_test.json").scene;
  if (options.every > 1) {
    const std::size_t n_all = test.frames.size();
    std::vector<io::Frame> kept;
    for (std::size_t i = 0; i < n_all; i += static_cast<std::size_t>(options.every))
      kept.push_back(test.frames[i]);
    test.frames = std::move(kept);
    stage.Decide(fmt::format("scored {} of {} held-out views", test.frames.size(), n_all));
  }
  RenderViews(*nerf::TrainedField::Load(checkpoint), test, stage.folder(), options.threads);
  const Evaluation result = ScoreViews(test, stage.folder(), options);
  const std::string protocol = ProtocolName(common.out) + (result.masked ? ", masked" : "");
  WriteScores(result, protocol, stage.folder());

  const ViewScore& worst = result.views[result.WorstFirst()[0]];
  fmt::print(
      "evaluate: {} held-out views ({}): PSNR {:.2f} dB, SSIM {:.4f}, FLIP {:.4f}; worst {} {:.2f} dB\n",
      result.views.size(),
      protocol,
      result.psnr_db,
      result.ssim,
      result.flip,
      worst.name,
      worst.psnr_db);
  if (result.masked) stage.Decide("scores and their means are over the pixels that the masks use");
  if (result.white_background) stage.Decide("pictures with alpha are scored on white, as NeRF's papers do");
  stage.Set("protocol", protocol);
  stage.Set("views", static_cast<double>(result.views.size()));
  stage.Set("psnr", result.psnr_db);
  stage.Set("ssim", result.ssim);
  stage.Set("flip", result.flip);
  stage.Finish();
}

}  // namespace

int RunEvaluate(int argc, const char* const* argv) {
  return GuardedMain("pipeline evaluate", [&] {
    CommonOptions common;
    EvaluationOptions options;
    Options bound(
        "pipeline evaluate",
        "Scores the trained field on the held-out views: PSNR, SSIM and FLIP per picture, and strips\n"
        "truth | render | error, worst first.");
    AddCommonOptions(&bound, &common);
    AddEvaluateOptions(&bound, &options);
    if (!bound.Parse(argc, argv)) return;
    options.threads = ResolvedThreads(common);
    if (NeedsTorch(common.out / "train/checkpoint.bin")) ContinueWithTorch("evaluate", argc, argv);
    Evaluate(common, options, bound);
  });
}

}  // namespace pipeline
