#include "sfm/bundle/camera_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sfm/bundle/bundle_adjustment.h"
#include "sfm/bundle/bundle_uncertainty.h"

namespace sfm {
namespace {

constexpr double kMinSignificance = 3;
constexpr double kMaxPrincipalPointSigmaPx = 5;
// For a comparison at 0.5 %: the error of the adjustment is then below 0.02 %.
constexpr double kTolerance = 1e-4;
constexpr int kIterations = 50;

// The intrinsics, less the values that an extension starts from.
IntrinsicVector Change(const CameraTrial& trial, const io::Scene& start, std::size_t camera) {
  IntrinsicVector change = ToVector(trial.scene.cameras[camera]);
  change[kAspect] -= 1;
  change[kCx] -= start.cameras[camera].cx;
  change[kCy] -= start.cameras[camera].cy;
  return change;
}

}  // namespace

CameraTrial RunTrial(const ObservationSplit& split, const std::vector<FreeIntrinsics>& free) {
  io::ColmapModel model = split.training;
  for (std::size_t i = 0; i < free.size(); ++i) {
    model.scene.cameras[i] = Reduced(model.scene.cameras[i], free[i]);
  }
  AdjustBundle(&model, {.free = free, .max_iterations = kIterations, .function_tolerance = kTolerance});
  return {.free = free,
          .scene = {.cameras = model.scene.cameras, .frames = model.scene.frames},
          .sigma = EstimateUncertainty(model, free, false).intrinsics,
          .held_out_px = HeldOutPx(model.scene, split.held_out)};
}

bool IsSignificant(const CameraExtension& extension,
                   const CameraTrial& trial,
                   const io::Scene& start,
                   std::size_t camera) {
  const IntrinsicVector change = Change(trial, start, camera), &sigma = trial.sigma[camera];
  const auto significant = [&](int i) { return std::abs(change[i]) > kMinSignificance * sigma[i]; };
  if (extension.added.principal_point) {
    return std::max(sigma[kCx], sigma[kCy]) < kMaxPrincipalPointSigmaPx &&
           (significant(kCx) || significant(kCy));
  }
  const std::vector<int> added = FreeIndices(extension.added);
  return std::all_of(added.begin(), added.end(), significant);
}

std::string Figures(const CameraExtension& extension,
                    const CameraTrial& trial,
                    const io::Scene& start,
                    std::size_t camera) {
  static const char* const kNames[kIntrinsics] = {
      "f", "fl_y/fl_x - 1", "cx shift", "cy shift", "k1", "k2", "p1", "p2"};
  const IntrinsicVector change = Change(trial, start, camera);
  std::string text = fmt::format(", camera {}", camera);
  const char* separator = " ";
  for (const int i : FreeIndices(extension.added)) {
    text += fmt::format("{}{} {:.5g} +- {:.2g}", separator, kNames[i], change[i], trial.sigma[camera][i]);
    separator = ", ";
  }
  return text;
}

double FocalSpread(const CameraTrial& own,
                   const CameraTrial& shared,
                   const std::vector<std::size_t>& shared_camera) {
  double squares = 0, n = 0;
  for (std::size_t i = 0; i < own.free.size(); ++i) {
    if (!std::isfinite(own.sigma[i][kFocal])) continue;
    const double change = own.scene.cameras[i].fl_x - shared.scene.cameras[shared_camera[i]].fl_x;
    squares += change * change / (own.sigma[i][kFocal] * own.sigma[i][kFocal]);
    n += 1;
  }
  return n > 0 ? std::sqrt(squares / n) : 0;
}

}  // namespace sfm
