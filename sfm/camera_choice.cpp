#include "sfm/camera_choice.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "io/error.h"
#include "sfm/observation_split.h"

namespace sfm {
namespace {

using Decide = std::function<void(const std::string&)>;

constexpr double kMinSignificance = 3;
// What the faults of every lens model yield by chance is not worth its cost in poses: on a surveyed capture,
// k1 lowered the error by 0.3 %, was 6 sigma, and moved the cameras a fifth further from the truth.
constexpr double kMinFall = 0.01;
// Off by 0.5 % of the picture in the same surveyed captures, the principal point cost 1.2 to 1.6 % of this
// error, but more than half of the accuracy of the poses.
constexpr double kMinPrincipalPointFall = 0.005;
constexpr double kMaxPrincipalPointSigmaPx = 5;
constexpr double kMaxFocalSigma = 0.02;  // share of the focal length; metadata is usually better than that
constexpr int kMinCameraObservations = 200;
constexpr std::size_t kMinHeldOut = 50;  // fewer do not tell 1 %
// Enough for a comparison at 0.5 %: the error of the adjustment is then below 0.02 %.
constexpr double kTrialTolerance = 1e-4;
constexpr int kTrialIterations = 50;

template <typename... Arguments>
std::string Format(const char* format, Arguments... arguments) {
  char text[400];
  std::snprintf(text, sizeof text, format, arguments...);
  return text;
}

// One enlargement of the camera model.
struct Step {
  std::string name, parameters;
  FreeIntrinsics added;
  double min_fall = kMinFall;
};

const std::vector<Step>& Ladder() {
  static const std::vector<Step> steps = {
      {"SIMPLE_RADIAL", "k1", {.k1 = true}},
      {"RADIAL", "k2", {.k2 = true}},
      {"OPENCV", "fl_y, p1, p2", {.aspect = true, .tangential = true}},
  };
  return steps;
}

const Step& PrincipalPointStep() {
  static const Step step = {"", "principal point", {.principal_point = true}, kMinPrincipalPointFall};
  return step;
}

FreeIntrinsics Union(const FreeIntrinsics& a, const FreeIntrinsics& b) {
  return {.focal = a.focal || b.focal,
          .aspect = a.aspect || b.aspect,
          .principal_point = a.principal_point || b.principal_point,
          .k1 = a.k1 || b.k1,
          .k2 = a.k2 || b.k2,
          .tangential = a.tangential || b.tangential};
}

// `camera` without what the model of `free` does not have.
io::Camera Reduced(io::Camera camera, const FreeIntrinsics& free) {
  if (!free.aspect && camera.fl_x != camera.fl_y) {
    camera.fl_x = camera.fl_y = std::sqrt(camera.fl_x * camera.fl_y);
  }
  if (!free.k1) camera.k1 = 0;
  if (!free.k2) camera.k2 = 0;
  if (!free.tangential) camera.p1 = camera.p2 = 0;
  return camera;
}

FreeIntrinsics FreeParametersOf(const std::string& camera_model) {
  if (camera_model == "PINHOLE") return {.focal = true, .aspect = true};
  FreeIntrinsics free{.focal = true};
  if (camera_model == "SIMPLE_PINHOLE") return free;
  for (const Step& step : Ladder()) {
    free = Union(free, step.added);
    if (step.name == camera_model) return free;
  }
  throw io::Error(io::ExitCode::kUsage,
                  "--camera-model: '" + camera_model + "' is not supported",
                  "Use auto, SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV");
}

// An adjustment of the training part with one choice of free parameters.
struct Trial {
  std::vector<FreeIntrinsics> free;
  std::vector<io::Camera> cameras;
  std::vector<IntrinsicVector> sigma;
  double held_out_px = 0;
};

struct Attempt {
  const Step* step;
  Trial trial;
  std::vector<bool> needs;  // the cameras it is significant in
  bool helps = false;
  std::string figures;  // one line
};

class Chooser {
 public:
  Chooser(const io::ColmapModel& model, const CameraChoiceOptions& options, const Decide& decide)
      : options_(options),
        decide_(decide),
        split_(SplitObservations(model, options.seed)),
        observations_(model.scene.cameras.size()),
        focal_is_free_(model.scene.cameras.size(), true) {
    for (const io::Observation& o : model.observations) {
      ++observations_[static_cast<std::size_t>(
          model.scene.frames[static_cast<std::size_t>(o.frame_index)].camera_index)];
    }
    if (options.camera_model == "auto" && split_.held_out.size() < kMinHeldOut) {
      fixed_model_ = model.camera_model;
      decide_(Format("camera model stays %s: only %zu observations can be held out to compare",
                     fixed_model_.c_str(),
                     split_.held_out.size()));
    } else if (options.camera_model != "auto") {
      fixed_model_ = options.camera_model;
    }
  }

  // Returns the accepted trial; the name of its model in `camera_model`.
  Trial Choose(std::string* camera_model) {
    Trial trial = Climb(camera_model);
    if (HoldWeakFocals(trial)) trial = Climb(camera_model);
    return trial;
  }

 private:
  // Enlarges the camera model by the step that helps most until none does.
  Trial Climb(std::string* camera_model) const {
    std::vector<FreeIntrinsics> free(observations_.size());
    *camera_model = fixed_model_.empty() ? "SIMPLE_PINHOLE" : fixed_model_;
    for (std::size_t i = 0; i < free.size(); ++i) {
      free[i] = FreeParametersOf(*camera_model);
      free[i].focal = focal_is_free_[i];
    }
    Trial trial = Run(free);
    std::size_t rung = fixed_model_.empty() ? 0 : Ladder().size();
    std::vector<bool> on_rung = EnoughObservations();
    bool tries_principal_point = split_.held_out.size() >= kMinHeldOut, took_principal_point = false,
         climbed_later = false;
    for (;;) {
      std::vector<Attempt> attempts;
      if (rung < Ladder().size()) attempts.push_back(Try(Ladder()[rung], on_rung, trial));
      if (tries_principal_point) attempts.push_back(Try(PrincipalPointStep(), EnoughObservations(), trial));
      Attempt* best = nullptr;
      for (Attempt& attempt : attempts) {
        const bool better = !best || attempt.trial.held_out_px < best->trial.held_out_px;
        if (attempt.helps && better) best = &attempt;
      }
      if (!best) {
        for (const Attempt& attempt : attempts) decide_(attempt.figures);
        break;
      }
      decide_(best->figures);
      trial = std::move(best->trial);
      if (best->step == &PrincipalPointStep()) {
        tries_principal_point = false, took_principal_point = true;
      } else {
        *camera_model = best->step->name;
        on_rung = best->needs;
        ++rung;
        climbed_later = took_principal_point;
      }
    }
    return climbed_later ? WithPrincipalPointTriedAgain(trial) : trial;
  }

  // A principal point taken early may stand for what a later step explains better.
  Trial WithPrincipalPointTriedAgain(const Trial& trial) const {
    std::vector<FreeIntrinsics> free = trial.free;
    for (FreeIntrinsics& camera : free) camera.principal_point = false;
    Trial without = Run(free);
    Attempt again = Try(PrincipalPointStep(), EnoughObservations(), without);
    decide_(again.figures);
    return again.helps ? std::move(again.trial) : std::move(without);
  }

  std::vector<bool> EnoughObservations() const {
    std::vector<bool> enough;
    for (const int n : observations_) enough.push_back(n >= kMinCameraObservations);
    return enough;
  }

  // Tries the step in the `eligible` cameras and keeps it in those that need it.
  Attempt Try(const Step& step, const std::vector<bool>& eligible, const Trial& trial) const {
    Attempt attempt{.step = &step, .trial = Run(Enlarged(trial, step, eligible)), .needs = eligible};
    std::vector<bool>& needs = attempt.needs;
    for (std::size_t i = 0; i < needs.size(); ++i) {
      needs[i] = eligible[i] && IsSupported(step, attempt.trial, i);
    }
    const auto n_needs = std::count(needs.begin(), needs.end(), true);
    const auto& named = n_needs > 0 ? needs : eligible;
    const auto first = static_cast<std::size_t>(std::find(named.begin(), named.end(), true) - named.begin());
    const std::string figures =
        first < named.size() ? ", camera " + std::to_string(first) + " " + Figures(step, attempt.trial, first)
                             : "";
    if (n_needs > 0 && needs != eligible) attempt.trial = Run(Enlarged(trial, step, needs));
    attempt.helps = n_needs > 0 && attempt.trial.held_out_px < (1 - step.min_fall) * trial.held_out_px;
    attempt.figures =
        Format("%s %s: held-out error %.4f -> %.4f px%s, significant in %d of %zu cameras",
               (step.name.empty() ? step.parameters : step.name + " (" + step.parameters + ")").c_str(),
               attempt.helps ? "is needed" : "is not needed",
               trial.held_out_px,
               attempt.trial.held_out_px,
               figures.c_str(),
               static_cast<int>(n_needs),
               needs.size());
    return attempt;
  }

  static std::vector<FreeIntrinsics> Enlarged(const Trial& trial,
                                              const Step& step,
                                              const std::vector<bool>& where) {
    std::vector<FreeIntrinsics> free = trial.free;
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (where[i]) free[i] = Union(free[i], step.added);
    }
    return free;
  }

  // What the step changes in a camera, beside the value it would keep without.
  IntrinsicVector Change(const Trial& trial, std::size_t camera) const {
    IntrinsicVector change = ToVector(trial.cameras[camera]);
    change[kAspect] -= 1;
    change[kCx] -= split_.training.scene.cameras[camera].cx;
    change[kCy] -= split_.training.scene.cameras[camera].cy;
    return change;
  }

  bool IsSupported(const Step& step, const Trial& trial, std::size_t camera) const {
    const IntrinsicVector change = Change(trial, camera), &sigma = trial.sigma[camera];
    const auto significant = [&](int i) { return std::abs(change[i]) > kMinSignificance * sigma[i]; };
    if (step.added.principal_point) {
      return std::max(sigma[kCx], sigma[kCy]) < kMaxPrincipalPointSigmaPx &&
             (significant(kCx) || significant(kCy));
    }
    const std::vector<int> added = FreeIndices(step.added);
    return std::all_of(added.begin(), added.end(), significant);
  }

  std::string Figures(const Step& step, const Trial& trial, std::size_t camera) const {
    static const char* const kNames[kIntrinsics] = {
        "f", "fl_y/fl_x - 1", "cx shift", "cy shift", "k1", "k2", "p1", "p2"};
    const IntrinsicVector change = Change(trial, camera);
    std::string text;
    for (const int i : FreeIndices(step.added)) {
      text +=
          Format("%s%s %.5g +- %.2g", text.empty() ? "" : ", ", kNames[i], change[i], trial.sigma[camera][i]);
    }
    return text;
  }

  // Every trial starts from the input: a start warped by too simple a camera could lead elsewhere.
  Trial Run(const std::vector<FreeIntrinsics>& free) const {
    io::ColmapModel model = split_.training;
    for (std::size_t i = 0; i < free.size(); ++i) {
      model.scene.cameras[i] = Reduced(model.scene.cameras[i], free[i]);
    }
    AdjustBundle(&model,
                 {.free = free, .max_iterations = kTrialIterations, .function_tolerance = kTrialTolerance});
    return {.free = free,
            .cameras = model.scene.cameras,
            .sigma = EstimateUncertainty(model, free, false).intrinsics,
            .held_out_px = HeldOutPx(model.scene, split_.held_out)};
  }

  bool HoldWeakFocals(const Trial& trial) {
    bool any = false;
    for (std::size_t i = 0; i < trial.cameras.size(); ++i) {
      const double sigma = trial.sigma[i][kFocal] / trial.cameras[i].fl_x;
      if (observations_[i] == 0 || !(sigma > kMaxFocalSigma)) continue;
      focal_is_free_[i] = false;
      any = true;
      io::Camera& camera = split_.training.scene.cameras[i];
      const double known = i < options_.known_focal_px.size() ? options_.known_focal_px[i] : 0;
      if (known > 0) {
        camera.fl_y *= known / camera.fl_x;
        camera.fl_x = known;
      }
      decide_(Format(
          "focal length of camera %zu is held at %.6g px (%s): the pictures determine it to %.2g %% only",
          i,
          camera.fl_x,
          known > 0 ? "known" : "a guess",
          100 * sigma));
    }
    return any;
  }

  const CameraChoiceOptions& options_;
  const Decide& decide_;
  ObservationSplit split_;
  std::vector<int> observations_;  // per camera, of the whole model
  std::vector<bool> focal_is_free_;
  std::string fixed_model_;  // empty: by need
};

}  // namespace

CameraChoice AdjustWithNeededCamera(io::ColmapModel* model,
                                    const CameraChoiceOptions& options,
                                    const Decide& decide) {
  CameraChoice choice;
  const Trial trial = Chooser(*model, options, decide).Choose(&choice.camera_model);
  choice.free = trial.free;
  io::ColmapModel adjusted = *model;
  adjusted.camera_model = choice.camera_model;
  adjusted.scene.cameras = trial.cameras;
  choice.adjustment = AdjustBundle(&adjusted, {.free = choice.free});
  choice.uncertainty = EstimateUncertainty(adjusted, choice.free, true);
  choice.filter = RemoveWeakObservations(&adjusted);
  *model = std::move(adjusted);
  decide(
      Format("camera model %s: %d iterations on %zu observations, error %.3f px (RMS), %d observations and "
             "%d points removed",
             choice.camera_model.c_str(),
             choice.adjustment.iterations,
             model->observations.size(),
             choice.filter.rms_px,
             choice.filter.removed_observations,
             choice.filter.removed_points));
  return choice;
}

}  // namespace sfm
