#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "io/base/quoting.h"
#include "io/scene/transforms.h"
#include "pipeline/evaluation/error_budget.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/evaluation/verdict.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_run.h"
#include "pipeline/stages/rank_session.h"
#include "pipeline/stages/scene_record.h"
#include "pipeline/stages/stage_options.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/torch_program.h"
#include "pipeline/stages/trained_scene.h"

namespace pipeline {
namespace {

constexpr int kMostRaysPerPixel = 4;  // that training sets

void Evaluate(const CommonOptions& common, const EvaluationOptions& options, const Options& bound) {
  const std::filesystem::path scene_folder = common.out / "scene",
                              checkpoint = common.out / "train/checkpoint.bin";
  StageRun stage("evaluate", common, bound, {scene_folder, checkpoint}, true);
  RequireTrainedOnThisScene(stage, checkpoint);
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
  std::size_t rendering = 0;
  for (const io::Camera& camera : test.cameras)
    rendering = std::max(rendering, nerf::RenderingBytes(camera, kMostRaysPerPixel));
  options.memory.Require(nerf::LoadedFieldBytes(checkpoint) + rendering, "evaluate: rendering a view");
  const std::unique_ptr<nerf::TrainedField> field = nerf::TrainedField::Load(checkpoint);
  RenderViews(*field, test, stage.folder(), options.threads);
  Scores scores = ScoreViews(test, stage.folder(), options);
  const io::Scene train = ReadTrainingScene(common.out);
  scores.training_psnr_db = TrainingPsnr(*field, train, options.threads);
  scores.hidden_points = HiddenPoints(*field, train, test, options.threads);
  scores.protocol = ReadSceneRecord(common.out).protocol + (scores.masked ? ", masked" : "");
  const Verdict verdict = Judge(scores);
  // Where views are not shown at all, there is nothing that a pose could be fitted to.
  if (options.error_budget && verdict.outcome != Outcome::kFailed)
    MeasureErrors(*field, train, test, options.threads, &scores);
  if (!stage.Leads()) return;
  WriteScores(scores, stage.folder());

  const ViewScore& worst = scores.views[scores.WorstFirst()[0]];
  const std::string fitted =
      scores.budget
          ? fmt::format(", own poses fitted {:+.2f}", scores.budget->fitted_psnr_db - scores.budget->psnr_db)
          : "";
  std::printf("%s",
              fmt::format("evaluate: {} held-out views ({}): PSNR {:.2f} dB (colours aligned {:.2f}{}), SSIM "
                          "{:.4f}, FLIP {:.4f}; worst {} {:.2f} dB\n",
                          scores.views.size(),
                          scores.protocol,
                          scores.psnr_db,
                          scores.aligned_psnr_db,
                          fitted,
                          scores.ssim,
                          scores.flip,
                          io::Printable(worst.name),
                          worst.psnr_db)
                  .c_str());
  if (verdict.outcome != Outcome::kReconstructed)
    stage.Decide(std::string(verdict.outcome == Outcome::kFailed ? "not reconstructed: " : "doubtful: ") +
                 verdict.text);
  if (!verdict.strays.empty())
    stage.Decide(fmt::format("{} views lie 6 dB or more below the median: {}",
                             verdict.strays.size(),
                             fmt::join(verdict.strays, ", ")));
  for (const std::string& advice : Advice(scores)) stage.Decide(advice);
  if (scores.masked) stage.Decide("scores and their means are over the pixels that the masks use");
  if (scores.white_background) stage.Decide("pictures with alpha are scored on white, as NeRF's papers do");
  stage.Set("protocol", scores.protocol);
  stage.Set("views", static_cast<double>(scores.views.size()));
  stage.Set("psnr", scores.psnr_db);
  stage.Set("colour_aligned_psnr", scores.aligned_psnr_db);
  if (scores.budget)
    stage.Set("pose_fitted_psnr_gain", scores.budget->fitted_psnr_db - scores.budget->psnr_db);
  stage.Set("ssim", scores.ssim);
  stage.Set("flip", scores.flip);
  stage.Finish();
}

}  // namespace

int RunEvaluate(int argc, const char* const* argv) {
  return GuardedMain("pipeline evaluate", [&] {
    CommonOptions common;
    EvaluationOptions options;
    Options bound(
        "pipeline evaluate",
        "Scores the trained field on the held-out views: PSNR, SSIM and FLIP per picture; the worst are\n"
        "written as photograph, rendering and error.");
    AddCommonOptions(&bound, &common);
    AddEvaluateOptions(&bound, &options);
    if (!bound.Parse(argc, argv)) return;
    const RankSession session("evaluate", common.out, argc, argv);
    options.threads = ResolvedThreads(common);
    options.memory = ResolvedMemory(common);
    if (NeedsTorch(common.out / "train/checkpoint.bin")) ContinueWithTorch("evaluate", argc, argv);
    Evaluate(common, options, bound);
  });
}

}  // namespace pipeline
