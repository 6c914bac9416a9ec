// What the report shows, gathered from the files of a run folder. Every part may be missing.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/scene/scene.h"
#include "nerf/training/training_curve.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/evaluation/scores.h"
#include "pipeline/film/support_pictures.h"

namespace pipeline {

struct StageSummary {
  std::string name, help;
  bool done = false;
  double wall_s = 0, cpu_s = 0;
  double peak_rss_bytes = 0;
  std::vector<std::string> decisions;  // why what was chosen
  std::string command;                 // as typed in a shell
};

struct NamedText {
  std::string name, text;
};

struct ComparedView {
  ViewScore score;
  std::optional<Comparison> pictures;  // nothing when none were written
};

// A training picture that shows what the others do not.
struct LeftOut {
  io::Frame frame;   // with the mask of what training used
  double share = 0;  // of its pixels, that training left out
};

struct ReportData {
  std::string name;         // of the input, or of the run folder where that is unknown
  std::string input;        // what the user gave; empty when unknown
  std::string run_command;  // of `pipeline run`; empty when stages were started one by one
  std::string host, versions;
  std::vector<StageSummary> stages;
  double total_wall_s = 0;

  bool has_ingest = false, has_sfm = false, has_scores = false;
  int kept = 0, dropped = 0;
  std::vector<NamedText> kept_pictures, dropped_pictures;  // with notes, with reasons
  int masks = 0;                                           // pictures of the scene that have one
  double used_share = 0;  // of all pixels of the scene, where there are masks
  int images = 0, registered = 0, points = 0;
  double reprojection_error_px = 0;
  std::vector<NamedText> unregistered;        // with causes
  std::vector<NamedText> pose_uncertainties;  // worst first

  double train_s = 0, train_steps = 0, train_parameters = 0;
  std::string field;
  nerf::CurveColumns curve;
  std::vector<LeftOut> left_out;  // the largest shares first

  Scores scores;
  std::vector<ComparedView> views;  // worst PSNR first

  std::filesystem::path film, depth_film, support_film;  // empty when missing
  std::vector<SupportPictures> support;
  bool has_scene_page = false;
  int film_frames = 0;
  double film_ms_per_frame = 0;
  std::string scene_json;  // cameras, points and film path for the plot; empty when there is no scene
};

// Throws kBadInput when the folder holds no finished stage or a file in it is damaged.
ReportData GatherReport(const std::filesystem::path& run_folder);

// {"points": [x, y, z, r, g, b, ...], "train": [[centre, four corners], ...], "test": ..., "path": [x, y, z,
// ...]} with the focus at the origin, z up, and lengths in units of the film's distance. Empty without
// scene/transforms_train.json.
std::string ScenePlotJson(const std::filesystem::path& run_folder);

}  // namespace pipeline
