#include <cstdio>

#include "io/base/error.h"
#include "io/scene/transforms.h"
#include "nerf/data/dataset.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_run.h"
#include "pipeline/stages/film.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/torch_program.h"

namespace pipeline {
namespace {

// Limits against typing errors: an hour of film, 8K.
constexpr int kMaxFrames = 216000, kMaxWidth = 7680;
constexpr double kMaxFps = 240;

void Render(const CommonOptions& common, const FilmOptions& options, const Options& bound) {
  const std::filesystem::path transforms = common.out / "scene/transforms_train.json";
  const std::filesystem::path checkpoint = common.out / "train/checkpoint.bin";
  StageRun stage("render", common, bound, {transforms, checkpoint}, true);
  if (stage.IsUpToDate()) return;
  const io::Scene train = io::ReadTransforms(transforms).scene;
  const Film film = RenderFilm(*nerf::TrainedField::Load(checkpoint), train, options, stage.folder());

  for (const std::string& decision : film.decisions) stage.Decide(decision);
  for (const io::VideoReport& video : film.videos) stage.AddChildUse(video.cpu_s, video.peak_rss_bytes);
  stage.Set("frames", options.frames);
  stage.Set("fps", options.fps);
  stage.Set("width", film.camera.width);
  stage.Set("height", film.camera.height);
  if (film.rendered > 0) stage.Set("ms_per_frame", film.ms_per_frame);
  stage.Set("film_bytes", static_cast<double>(film.videos[0].bytes));
  std::printf("render: %d frames of %dx%d, %.0f ms each\n",
              options.frames,
              film.camera.width,
              film.camera.height,
              film.ms_per_frame);
  stage.Finish();
}

}  // namespace

int RunRender(int argc, const char* const* argv) {
  return GuardedMain("pipeline render", [&] {
    CommonOptions common;
    FilmOptions options;
    Options bound("pipeline render", "Renders the novel-view film along an orbit fitted to the cameras.");
    AddCommonOptions(&bound, &common);
    bound.Add("frames", &options.frames, "frames of the film");
    bound.Add("fps", &options.fps, "frames per second of the film");
    bound.Add("size", &options.width, "width in pixels; 0 = that of the training pictures");
    bound.Add("depth", &options.depth, "also write depth.mp4");
    bound.Add("pixel-rays",
              &options.pixel_rays,
              "rays per pixel: 1, 4, 9 or 16; 0 = as in training; fewer are faster, and jagged");
    if (!bound.Parse(argc, argv)) return;
    const auto require = [](bool holds, const char* text) {
      if (!holds) throw io::Error(io::ExitCode::kUsage, text);
    };
    require(options.frames >= 2 && options.frames <= kMaxFrames, "--frames: must lie in 2 to 216000");
    require(options.fps >= 1 && options.fps <= kMaxFps, "--fps: must lie in 1 to 240");
    require(options.width >= 0 && options.width <= kMaxWidth, "--size: must lie in 0 to 7680");
    require(options.pixel_rays == 0 || nerf::IsSamplesPerPixel(options.pixel_rays),
            "--pixel-rays: must be 0, 1, 4, 9 or 16");
    options.threads = ResolvedThreads(common);
    if (NeedsTorch(common.out / "train/checkpoint.bin")) ContinueWithTorch("render", argc, argv);
    Render(common, options, bound);
  });
}

}  // namespace pipeline
