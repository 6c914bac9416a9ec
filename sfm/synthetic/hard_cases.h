// The hard cases of structure-from-motion as a table: generated captures, what is right to do with each, and
// how far off the poses may be.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sfm/mapping/refusal.h"
#include "sfm/scene/pose_error.h"
#include "sfm/synthetic/capture_options.h"

namespace sfm {

enum class Expectation { kModel, kRefusal, kModelOrRefusal };

// Limits hold for whatever model is accepted.
struct HardCase {
  std::string id;  // "S08.3": the third variant of case S08
  std::string title;
  CaptureOptions options;  // the seed is that of the run
  Expectation expectation = Expectation::kModel;
  double max_rotation_deg = 0.1;  // of the worst picture
  double max_centre = 0.1;  // root mean square, over the extent of the true centres; ignored where they do
                            // not fix a similarity
  double min_registered_share = 1;  // of the pictures
  double max_focal_error = 0;       // relative, of the worst camera; 0: not judged
  std::string camera_model;         // the one to be chosen; empty: any
  double max_doming = 0;            // see sfm/scene/doming.h; 0: not judged
};

struct HardCaseResult {
  int pictures = 0, registered = 0;
  PoseError error;         // of the accepted model
  double focal_error = 0;  // relative, of the worst camera; distortion shifts what a focal length means
  double doming = 0;       // of the points, see sfm/scene/doming.h
  int points_behind = 0;   // points of the model behind a camera that observes them
  std::string camera_model;
  std::optional<Refusal> refusal;  // none: a model was accepted
  std::string failure;             // any other error: a program that crashed, a damaged model
  double wall_s = 0, cpu_s = 0;    // of this process and its children
};

// More than this is no inaccuracy but a wrong model.
constexpr double kFoldedDeg = 1;

const std::vector<HardCase>& HardCases();

// Whether the result is what the case expects, within its limits.
bool Passes(const HardCase& limits, const HardCaseResult& result);

// Accepted with an error beyond kFoldedDeg: the one result that must never happen.
bool IsFolded(const HardCaseResult& result);

// Generates the capture with `seed`, reconstructs it in `work_folder` (emptied before and after).
// Throws only what concerns the run as a whole: io::Interrupted, and kMissingTool without COLMAP.
HardCaseResult RunHardCase(const HardCase& hard_case,
                           std::uint64_t seed,
                           const std::filesystem::path& work_folder,
                           int threads);

}  // namespace sfm
