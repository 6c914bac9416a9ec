#include <algorithm>
#include <cstdio>

#include "io/scene/transforms.h"
#include "pipeline/film/film.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_run.h"
#include "pipeline/stages/rank_session.h"
#include "pipeline/stages/stage_options.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/torch_program.h"
#include "pipeline/stages/trained_scene.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

// Longer side of the photos as `sfm` undistorted them; 0 when the poses were given and it is not known.
int PhotoSide(const fs::path& sfm_transforms) {
  if (!fs::is_regular_file(sfm_transforms)) return 0;
  int side = 0;
  for (const io::Camera& camera : io::ReadTransforms(sfm_transforms).scene.cameras)
    side = std::max({side, camera.width, camera.height});
  return side;
}

void Render(const CommonOptions& common, FilmOptions options, const Options& bound) {
  const fs::path transforms = common.out / "scene/transforms_train.json";
  const fs::path checkpoint = common.out / "train/checkpoint.bin";
  std::vector<fs::path> inputs = {transforms, checkpoint};
  for (const fs::path& file : {options.path, options.crop})
    if (!file.empty()) inputs.push_back(file);
  StageRun stage("render", common, bound, inputs, true);
  RequireTrainedOnThisScene(stage, checkpoint);
  if (stage.IsUpToDate()) return;
  options.photo_side = PhotoSide(common.out / "sfm/transforms.json");
  const io::Scene train = ReadTrainingScene(common.out);
  options.memory.Require(nerf::LoadedFieldBytes(checkpoint), "render: the field");
  const Film film = RenderFilm(*nerf::TrainedField::Load(checkpoint), train, options, stage.folder());
  if (!stage.Leads()) return;

  for (const std::string& decision : film.decisions) stage.Decide(decision);
  for (const io::VideoReport& video : film.videos) stage.AddChildUse(video.cpu_s, video.peak_rss_bytes);
  stage.Set("frames", film.frames);
  stage.Set("fps", film.fps);
  stage.Set("width", film.size.camera.width);
  stage.Set("height", film.size.camera.height);
  if (film.rendered > 0) stage.Set("ms_per_frame", film.ms_per_frame);
  stage.Set("film_bytes", static_cast<double>(film.videos[0].bytes));
  std::printf("render: %d frames of %dx%d, %.0f ms each\n",
              film.frames,
              film.size.camera.width,
              film.size.camera.height,
              film.ms_per_frame);
  stage.Finish();
}

}  // namespace

int RunRender(int argc, const char* const* argv) {
  return GuardedMain("pipeline render", [&] {
    CommonOptions common;
    FilmFlags flags;
    Options bound(
        "pipeline render",
        "Renders the novel-view film. Its path follows the capture: around a subject, among cameras that\n"
        "look the same way, or along those of a walk; never where no picture was taken nearby.");
    AddCommonOptions(&bound, &common);
    AddRenderOptions(&bound, &flags);
    if (!bound.Parse(argc, argv)) return;
    FilmOptions options = flags.film;
    options.ceiling_s = ParseDuration("max-time", flags.max_time);
    const RankSession session("render", common.out, argc, argv);
    options.threads = ResolvedThreads(common);
    options.memory = ResolvedMemory(common);
    if (NeedsTorch(common.out / "train/checkpoint.bin")) ContinueWithTorch("render", argc, argv);
    Render(common, options, bound);
  });
}

}  // namespace pipeline
