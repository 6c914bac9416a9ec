#include "pipeline/stages/stage_options.h"

#include "io/base/error.h"

namespace pipeline {
namespace {

void RefuseFewFeatures(const std::string& option_name, const std::string& text) {
  const int n = std::stoi(text);
  if (n != 0 && n < 100)
    throw io::Error(
        io::ExitCode::kUsage, "--" + option_name + ": " + text + " features are too few", "See --help");
}

void RefuseOneFrame(const std::string& option_name, const std::string& text) {
  if (std::stoi(text) == 1)
    throw io::Error(
        io::ExitCode::kUsage, "--" + option_name + ": a film has at least 2 frames", "See --help");
}

}  // namespace

void AddSfmOptions(Options* options, sfm::ReconstructionOptions* sfm) {
  options->Add("features",
               &sfm->features,
               "SIFT features per picture, at least 100; 0 = 4096, beyond 400 pictures down to 2048",
               {.min = 0, .max = 16384, .check = RefuseFewFeatures});
  options->Add("detect-size",
               &sfm->max_image_size,
               "longer side of the picture in which features are detected [px]; 0 = full size",
               {.min = 0});
  options->Add("detector", &sfm->detector, "whose SIFT: opencv or colmap", {.choices = {"opencv", "colmap"}});
  options->Add("camera-model",
               &sfm->camera_model,
               "auto (as simple as the data allow), SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV",
               {.choices = {"auto", "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"}});
  options->Add("matching",
               &sfm->matching,
               "auto, exhaustive, likely (most alike pairs) or sequential (video)",
               {.choices = {"auto", "exhaustive", "likely", "sequential"}});
  options->Add(
      "mapping",
      &sfm->mapping,
      "auto (in blocks beyond 120 pictures), whole, or blocks: overlapping ones, side by side, then joined",
      {.choices = {"auto", "whole", "blocks"}});
  options->Add("retry-minutes",
               &sfm->retry_minutes,
               "ceiling for further attempts with stronger settings; 0 = none",
               {.min = 0});
}

void AddNormalizeOptions(Options* options, NormalizeFlags* normalize) {
  options->Add(
      "poses", &normalize->poses, "transforms.json, its folder, or a COLMAP model; if not given, OUT/sfm");
  options->Add("images", &normalize->images, "pictures of a COLMAP model; if not given, searched beside it");
  options->Add(
      "image-size", &normalize->image_size, "longest side for training, pixels; 0 = keep", {.min = 0});
  options->Add("holdout",
               &normalize->holdout,
               "test views: every n-th picture, or a sector of as many, one side of the capture",
               {.choices = {"every", "sector"}});
  options->Add("holdout-every", &normalize->holdout_every, "one in n pictures is a test view", {.min = 2});
}

void AddEvaluateOptions(Options* options, EvaluationOptions* evaluate) {
  options->Add(
      "every", &evaluate->every, "score every n-th held-out view only, for slow fields; 1 = all", {.min = 1});
  options->Add("max-strips",
               &evaluate->max_strips,
               "views whose photograph, rendering and error are written, worst first",
               {.min = 0});
  options->Add("error-budget",
               &evaluate->error_budget,
               "measure where the error lies: about four more renders of each of up to 24 views");
}

void AddRenderOptions(Options* options, FilmFlags* flags) {
  FilmOptions* render = &flags->film;
  // Limits against typing errors: an hour of film at 60 frames per second, 8K.
  options->Add("frames",
               &render->frames,
               "frames of the film, at least 2; 0 = 6 seconds, up to 12 for a long walk",
               {.min = 0, .max = 216000, .check = RefuseOneFrame});
  options->Add("path",
               &render->path,
               "camera_path.json of `pipeline view` or nerfstudio, in the coordinates of OUT/scene; it then "
               "decides frames, fps and shape");
  options->Add("crop",
               &render->crop,
               "camera_path.json with a crop box, outside which nothing is filmed; default: that of --path");
  options->Add("fps", &render->fps, "frames per second of the film", {.min = 1, .max = 240});
  options->Add("size",
               &render->width,
               "width in pixels; 0 = longer side 1280, as far as the photos and --max-time allow it",
               {.min = 0, .max = 7680});
  options->Add("max-time",
               &flags->max_time,
               "ceiling of the rendering time: the film becomes smaller, at least as large as the training "
               "pictures; not with --size",
               {.check = ParseDuration});
  options->Add("depth", &render->depth, "also write depth.mp4");
  options->Add("support",
               &render->support,
               "also write support.mp4: how many training views saw what a pixel shows, blue one, red all");
  options->Add("pixel-rays",
               &render->pixel_rays,
               "rays per pixel: 1, 4, 9 or 16; 0 = as in training; fewer are faster, and jagged",
               {.choices = {"0", "1", "4", "9", "16"}});
}

}  // namespace pipeline
