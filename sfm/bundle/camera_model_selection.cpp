#include "sfm/bundle/camera_model_selection.h"

#include <algorithm>
#include <cmath>

#include "io/base/format.h"
#include "sfm/bundle/camera_models.h"
#include "sfm/bundle/camera_split.h"
#include "sfm/bundle/observation_split.h"
#include "sfm/scene/pose_error.h"

namespace sfm {
namespace {

using io::Format;
using Decide = std::function<void(const std::string&)>;

constexpr double kMinSignificance = 3;
constexpr double kMaxPrincipalPointSigmaPx = 5;
constexpr double kMaxFocalSigma = 0.02;  // share of the focal length; metadata is usually better than that
// A radial term that turns a camera by more than this is judged by its significance alone: where poses depend
// on it so much, wrong poses fit the observations almost as well (S26: 3 degrees for 0.3 % of the error).
constexpr double kMaxTurnDeg = 0.5;
constexpr int kMinCameraObservations = 200;
constexpr std::size_t kMinHeldOut = 50;  // fewer do not tell 1 %
// For a comparison at 0.5 %: the error of the adjustment is then below 0.02 %.
constexpr double kTrialTolerance = 1e-4;
constexpr int kTrialIterations = 50;

// An adjustment of the training part with one choice of free parameters.
struct Trial {
  std::vector<FreeIntrinsics> free;
  io::Scene scene;  // without points
  std::vector<IntrinsicVector> sigma;
  double held_out_px = 0;
};

struct Attempt {
  std::size_t rungs;  // of the ladder; 0: the principal point
  Trial trial;
  std::vector<bool> needs;  // the cameras it is significant in
  bool helps = false;
  std::string figures;  // one line
};

class Chooser {
 public:
  // lens_of: of each camera, see FreeIntrinsics.
  Chooser(const io::ColmapModel& model,
          const std::vector<int>& lens_of,
          const CameraChoiceOptions& options,
          const Decide& decide)
      : options_(options),
        decide_(decide),
        lens_of_(lens_of),
        split_(SplitObservations(model, options.seed)),
        observations_(model.scene.cameras.size()),
        lens_observations_(model.scene.cameras.size()),
        focal_is_free_(model.scene.cameras.size(), true) {
    for (const io::Observation& o : model.observations) {
      const auto camera =
          static_cast<std::size_t>(model.scene.frames[static_cast<std::size_t>(o.frame_index)].camera_index);
      ++observations_[camera];
      ++lens_observations_[lens_of[camera] < 0 ? camera : static_cast<std::size_t>(lens_of[camera])];
    }
    if (options.camera_model == "auto" && !CanCompare()) {
      fixed_model_ = model.camera_model;
      decide_(Format("camera model stays %s: only %zu observations can be held out to compare",
                     fixed_model_.c_str(),
                     split_.held_out.size()));
    } else if (options.camera_model != "auto") {
      fixed_model_ = options.camera_model;
    }
  }

  bool CanCompare() const { return split_.held_out.size() >= kMinHeldOut; }

  // Returns the accepted trial; the name of its model in `camera_model`.
  Trial Choose(std::string* camera_model) {
    Trial trial = Climb(camera_model);
    if (HoldWeakFocals(trial)) trial = Climb(camera_model);
    return trial;
  }

  // Whether a focal length per picture describes the capture better than `shared`, whose camera
  // shared_camera[i] this chooser's camera i was split from.
  bool OwnFocalsHelp(const Trial& shared, const std::vector<std::size_t>& shared_camera) const {
    std::vector<FreeIntrinsics> free;
    for (std::size_t i = 0; i < lens_of_.size(); ++i) {
      free.push_back(shared.free[shared_camera[i]]);
      if (!free.back().focal) return false;  // what all pictures together do not tell, one does not
      free.back().lens_of = lens_of_[i];
    }
    const Trial own = Run(free);
    double squares = 0, n = 0;
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (!std::isfinite(own.sigma[i][kFocal])) continue;
      const double change = own.scene.cameras[i].fl_x - shared.scene.cameras[shared_camera[i]].fl_x;
      squares += change * change / (own.sigma[i][kFocal] * own.sigma[i][kFocal]);
      n += 1;
    }
    const double rms = n > 0 ? std::sqrt(squares / n) : 0;
    const CameraStep& step = OwnFocalsStep();
    const bool helps = rms > kMinSignificance && own.held_out_px < (1 - step.min_fall) * shared.held_out_px;
    decide_(Format("%s is %s: held-out error %.4f -> %.4f px, %.1f standard deviations from the shared one",
                   step.parameters.c_str(),
                   helps ? "needed" : "not needed",
                   shared.held_out_px,
                   own.held_out_px,
                   rms));
    return helps;
  }

 private:
  // Enlarges the camera model by the step that helps most until none does.
  Trial Climb(std::string* camera_model) const {
    std::vector<FreeIntrinsics> free(observations_.size());
    *camera_model = fixed_model_.empty() ? "SIMPLE_PINHOLE" : fixed_model_;
    for (std::size_t i = 0; i < free.size(); ++i) {
      free[i] = FreeParametersOf(*camera_model);
      free[i].focal = focal_is_free_[i];
      free[i].lens_of = lens_of_[i];
    }
    Trial trial = Run(free);
    std::size_t rung = fixed_model_.empty() ? 0 : CameraLadder().size();
    std::vector<bool> on_rung = EnoughObservations();
    bool tries_principal_point = CanCompare(), took_principal_point = false, climbed_later = false;
    for (;;) {
      std::vector<Attempt> attempts;
      if (rung < CameraLadder().size()) {
        attempts.push_back(Try(CameraLadder()[rung], 1, on_rung, trial));
        // A lens whose terms oppose each other shows in both or not at all.
        if (!attempts.back().helps && rung + 1 < CameraLadder().size()) {
          attempts.push_back(Try(Joined(CameraLadder()[rung], CameraLadder()[rung + 1]), 2, on_rung, trial));
        }
      }
      if (tries_principal_point) {
        attempts.push_back(Try(PrincipalPointStep(), 0, EnoughObservations(), trial));
      }
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
      if (best->rungs == 0) {
        tries_principal_point = false, took_principal_point = true;
      } else {
        rung += best->rungs;
        *camera_model = CameraLadder()[rung - 1].name;
        on_rung = best->needs;
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
    Attempt again = Try(PrincipalPointStep(), 0, EnoughObservations(), without);
    decide_(again.figures);
    return again.helps ? std::move(again.trial) : std::move(without);
  }

  std::vector<bool> EnoughObservations() const {
    std::vector<bool> enough;
    for (std::size_t i = 0; i < lens_of_.size(); ++i) {
      const int n = lens_observations_[lens_of_[i] < 0 ? i : static_cast<std::size_t>(lens_of_[i])];
      enough.push_back(n >= kMinCameraObservations);
    }
    return enough;
  }

  // Tries the step in the `eligible` cameras and keeps it in those that need it.
  Attempt Try(const CameraStep& step,
              std::size_t rungs,
              const std::vector<bool>& eligible,
              const Trial& trial) const {
    Attempt attempt{.rungs = rungs, .trial = Run(Enlarged(trial, step, eligible)), .needs = eligible};
    std::vector<bool>& needs = attempt.needs;
    for (std::size_t i = 0; i < needs.size(); ++i) {
      needs[i] = eligible[i] && IsSupported(step, attempt.trial, i);
    }
    const auto n_needs = std::count(needs.begin(), needs.end(), true);
    const auto& named = n_needs > 0 ? needs : eligible;
    const auto first = static_cast<std::size_t>(std::find(named.begin(), named.end(), true) - named.begin());
    if (n_needs > 0 && needs != eligible) attempt.trial = Run(Enlarged(trial, step, needs));
    const std::string figures = first < named.size() ? Figures(step, attempt.trial, first) : "";
    const double turn_deg = ComparePoses(attempt.trial.scene, trial.scene).rotation_max_deg;
    const bool is_radial = !step.added.principal_point && !step.added.tangential;
    const double min_fall = is_radial && turn_deg > kMaxTurnDeg ? 0 : step.min_fall;
    attempt.helps = n_needs > 0 && attempt.trial.held_out_px < (1 - min_fall) * trial.held_out_px;
    attempt.figures = Format(
        "%s %s: held-out error %.4f -> %.4f px%s, significant in %d of %zu cameras, poses turn by %.2g deg",
        step.Title().c_str(),
        attempt.helps ? "is needed" : "is not needed",
        trial.held_out_px,
        attempt.trial.held_out_px,
        figures.c_str(),
        static_cast<int>(n_needs),
        needs.size(),
        turn_deg);
    return attempt;
  }

  static std::vector<FreeIntrinsics> Enlarged(const Trial& trial,
                                              const CameraStep& step,
                                              const std::vector<bool>& where) {
    std::vector<FreeIntrinsics> free = trial.free;
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (where[i]) free[i] = Union(free[i], step.added);
    }
    return free;
  }

  // What the step changes in a camera, beside the value it would keep without.
  IntrinsicVector Change(const Trial& trial, std::size_t camera) const {
    IntrinsicVector change = ToVector(trial.scene.cameras[camera]);
    change[kAspect] -= 1;
    change[kCx] -= split_.training.scene.cameras[camera].cx;
    change[kCy] -= split_.training.scene.cameras[camera].cy;
    return change;
  }

  bool IsSupported(const CameraStep& step, const Trial& trial, std::size_t camera) const {
    const IntrinsicVector change = Change(trial, camera), &sigma = trial.sigma[camera];
    const auto significant = [&](int i) { return std::abs(change[i]) > kMinSignificance * sigma[i]; };
    if (step.added.principal_point) {
      return std::max(sigma[kCx], sigma[kCy]) < kMaxPrincipalPointSigmaPx &&
             (significant(kCx) || significant(kCy));
    }
    const std::vector<int> added = FreeIndices(step.added);
    return std::all_of(added.begin(), added.end(), significant);
  }

  std::string Figures(const CameraStep& step, const Trial& trial, std::size_t camera) const {
    static const char* const kNames[kIntrinsics] = {
        "f", "fl_y/fl_x - 1", "cx shift", "cy shift", "k1", "k2", "p1", "p2"};
    const IntrinsicVector change = Change(trial, camera);
    std::string text = Format(", camera %zu", camera);
    const char* separator = " ";
    for (const int i : FreeIndices(step.added)) {
      text += Format("%s%s %.5g +- %.2g", separator, kNames[i], change[i], trial.sigma[camera][i]);
      separator = ", ";
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
            .scene = {.cameras = model.scene.cameras, .frames = model.scene.frames},
            .sigma = EstimateUncertainty(model, free, false).intrinsics,
            .held_out_px = HeldOutPx(model.scene, split_.held_out)};
  }

  bool HoldWeakFocals(const Trial& trial) {
    bool any = false;
    for (std::size_t i = 0; i < trial.scene.cameras.size(); ++i) {
      const double sigma = trial.sigma[i][kFocal] / trial.scene.cameras[i].fl_x;
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
  const std::vector<int> lens_of_;
  ObservationSplit split_;
  std::vector<int> observations_, lens_observations_;  // per camera and lens, of the whole model
  std::vector<bool> focal_is_free_;
  std::string fixed_model_;  // empty: by need
};

// The model and the trial of the camera choice. `model` may get a camera per picture.
Trial ChooseCamera(io::ColmapModel* model, const CameraChoiceOptions& options, const Decide& decide) {
  Chooser chooser(*model, std::vector(model->scene.cameras.size(), -1), options, decide);
  Trial trial = chooser.Choose(&model->camera_model);
  if (options.camera_model != "auto" || !chooser.CanCompare() ||
      model->scene.cameras.size() == model->scene.frames.size()) {
    return trial;
  }
  io::ColmapModel split = *model;
  for (std::size_t i = 0; i < trial.scene.cameras.size(); ++i) {
    split.scene.cameras[i].fl_x = trial.scene.cameras[i].fl_x;
    split.scene.cameras[i].fl_y = trial.scene.cameras[i].fl_y;
  }
  const auto [shared_camera, lens_of] = SplitCameras(&split.scene);
  CameraChoiceOptions split_options = options;
  split_options.known_focal_px.clear();
  Chooser own(split, lens_of, split_options, decide);
  if (!own.OwnFocalsHelp(trial, shared_camera)) return trial;
  *model = std::move(split);
  return own.Choose(&model->camera_model);
}

}  // namespace

CameraChoice AdjustWithNeededCamera(io::ColmapModel* model,
                                    const CameraChoiceOptions& options,
                                    const Decide& decide) {
  io::ColmapModel adjusted = *model;
  const Trial trial = ChooseCamera(&adjusted, options, decide);
  CameraChoice choice{.camera_model = adjusted.camera_model, .free = trial.free};
  adjusted.scene.cameras = trial.scene.cameras;
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
