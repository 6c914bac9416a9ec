#include "sfm/bundle/camera_model_selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "sfm/bundle/camera_split.h"
#include "sfm/bundle/camera_trial.h"
#include "sfm/bundle/point_adjustment.h"
#include "sfm/scene/pose_error.h"
#include "sfm/scene/undistort.h"

namespace sfm {
namespace {

using Decide = std::function<void(const std::string&)>;

constexpr double kMinFocalSpread = 3;
constexpr double kMaxFocalSigma = 0.02;  // share of the focal length; metadata is usually better than that
// A radial term that turns a camera by more than this is judged by its significance alone: where poses depend
// on it so much, wrong poses fit the observations almost as well. Seen from a drone straight above a plane,
// 3 degrees cost 0.3 % of the error.
constexpr double kMaxTurnDeg = 0.5;
constexpr int kMinCameraObservations = 200;
constexpr std::size_t kMinHeldOut = 50;  // fewer do not tell 1 %
// Of the final adjustment, which begins near the minimum: on 300 pictures it leaves poses within 1e-4 degrees
// of it after 9 iterations; 16 more, down to 1e-6, move them by 2e-5.
constexpr double kNearTolerance = 1e-5;
constexpr const char* kTitle = "sfm: adjusting";

// An extension of the cameras, tried.
struct Candidate {
  std::size_t n_models;  // of CameraModels() that it adds; 0: the principal point
  CameraTrial trial;
  std::vector<bool> needed;  // the cameras it is significant in
  bool helps = false;
  std::string figures;  // one line
};

// What forward selection has reached.
struct Progress {
  CameraTrial trial;
  std::size_t n_models;       // of CameraModels() that are in use
  std::vector<bool> cameras;  // that need the last of them
  bool tries_principal_point;
  bool extended_since = false;  // by a model, after the principal point was taken
};

class ForwardSelection {
 public:
  // lens_of: of each camera, see FreeIntrinsics.
  ForwardSelection(const io::ColmapModel& model,
                   const std::vector<int>& lens_of,
                   const CameraModelOptions& options,
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
      ++lens_observations_[LensOwner(camera)];
    }
    if (options.camera_model != "auto") {
      fixed_model_ = options.camera_model;
    } else if (!CanCompare()) {
      fixed_model_ = model.camera_model;
      decide_(fmt::format("camera model stays {}: only {} observations can be held out to compare",
                          fixed_model_,
                          split_.held_out.size()));
    }
  }

  bool CanCompare() const { return split_.held_out.size() >= kMinHeldOut; }

  // Returns the accepted trial; the name of its model in `camera_model`.
  CameraTrial Select(std::string* camera_model) {
    CameraTrial trial = Extend(camera_model);
    if (HoldWeakFocals(trial)) trial = Extend(camera_model);
    return trial;
  }

  // Whether a focal length per picture describes the capture better than `shared`, whose camera
  // shared_camera[i] this capture's camera i was split from.
  bool OwnFocalsHelp(const CameraTrial& shared, const std::vector<std::size_t>& shared_camera) const {
    std::vector<FreeIntrinsics> free;
    for (std::size_t i = 0; i < lens_of_.size(); ++i) {
      free.push_back(shared.free[shared_camera[i]]);
      if (!free.back().focal) return false;  // what all pictures together do not tell, one does not
      free.back().lens_of = lens_of_[i];
    }
    const CameraTrial own = RunTrial(split_, free);
    const double spread = FocalSpread(own, shared, shared_camera);
    const CameraExtension& extension = OwnFocalsExtension();
    const bool helps =
        spread > kMinFocalSpread && own.held_out_px < (1 - extension.min_fall) * shared.held_out_px;
    decide_(fmt::format(
        "{} is {}: held-out error {:.4f} -> {:.4f} px, {:.1f} standard deviations from the shared one",
        extension.parameters,
        helps ? "needed" : "not needed",
        shared.held_out_px,
        own.held_out_px,
        spread));
    return helps;
  }

 private:
  // Takes the extension that helps most until none does.
  CameraTrial Extend(std::string* camera_model) const {
    *camera_model = fixed_model_.empty() ? "SIMPLE_PINHOLE" : fixed_model_;
    Progress progress{.trial = RunTrial(split_, Start(*camera_model)),
                      .n_models = fixed_model_.empty() ? 0 : CameraModels().size(),
                      .cameras = EnoughObservations(),
                      .tries_principal_point = CanCompare()};
    while (std::optional<Candidate> best = BestCandidate(progress)) {
      progress.trial = std::move(best->trial);
      if (best->n_models == 0) {
        progress.tries_principal_point = false;
      } else {
        progress.n_models += best->n_models;
        *camera_model = CameraModels()[progress.n_models - 1].model;
        progress.cameras = best->needed;
        progress.extended_since = CanCompare() && !progress.tries_principal_point;
      }
    }
    return progress.extended_since ? WithPrincipalPointTriedAgain(progress.trial) : progress.trial;
  }

  // The free parameters before any extension.
  std::vector<FreeIntrinsics> Start(const std::string& camera_model) const {
    std::vector<FreeIntrinsics> free(lens_of_.size(), FreeParametersOf(camera_model));
    for (std::size_t i = 0; i < free.size(); ++i) {
      free[i].focal = focal_is_free_[i];
      free[i].lens_of = lens_of_[i];
    }
    return free;
  }

  // The one that helps and has the smallest error; nothing when none helps.
  std::optional<Candidate> BestCandidate(const Progress& progress) const {
    std::vector<Candidate> candidates = Candidates(progress);
    Candidate* best = nullptr;
    for (Candidate& candidate : candidates) {
      const bool better = !best || candidate.trial.held_out_px < best->trial.held_out_px;
      if (candidate.helps && better) best = &candidate;
    }
    if (best) {
      decide_(best->figures);
      return std::move(*best);
    }
    for (const Candidate& candidate : candidates) decide_(candidate.figures);
    return std::nullopt;
  }

  std::vector<Candidate> Candidates(const Progress& progress) const {
    const std::vector<CameraExtension>& models = CameraModels();
    const std::size_t next = progress.n_models;
    std::vector<Candidate> candidates;
    if (next < models.size()) {
      candidates.push_back(Try(models[next], 1, progress.cameras, progress.trial));
      // A lens whose terms oppose each other shows in both or not at all.
      if (!candidates.back().helps && next + 1 < models.size()) {
        candidates.push_back(
            Try(Joined(models[next], models[next + 1]), 2, progress.cameras, progress.trial));
      }
    }
    if (progress.tries_principal_point) candidates.push_back(TryPrincipalPoint(progress.trial));
    return candidates;
  }

  // A principal point taken early may stand for what a later extension explains better.
  CameraTrial WithPrincipalPointTriedAgain(const CameraTrial& trial) const {
    std::vector<FreeIntrinsics> free = trial.free;
    for (FreeIntrinsics& camera : free) camera.principal_point = false;
    CameraTrial without = RunTrial(split_, free);
    Candidate again = TryPrincipalPoint(without);
    decide_(again.figures);
    return again.helps ? std::move(again.trial) : std::move(without);
  }

  Candidate TryPrincipalPoint(const CameraTrial& trial) const {
    return Try(PrincipalPointExtension(), 0, EnoughObservations(), trial);
  }

  // Tries the extension in the `eligible` cameras and keeps it in those that need it.
  Candidate Try(const CameraExtension& extension,
                std::size_t n_models,
                const std::vector<bool>& eligible,
                const CameraTrial& before) const {
    CameraTrial trial = RunTrial(split_, Extended(before.free, extension, eligible));
    std::vector<bool> needed = eligible;
    for (std::size_t i = 0; i < needed.size(); ++i) {
      needed[i] = eligible[i] && IsSignificant(extension, trial, split_.training.scene, i) &&
                  HasRaysAtBorder(trial.scene.cameras[i]);
    }
    const auto n_needed = std::count(needed.begin(), needed.end(), true);
    const auto& named = n_needed > 0 ? needed : eligible;
    const auto first = static_cast<std::size_t>(std::find(named.begin(), named.end(), true) - named.begin());
    if (n_needed > 0 && needed != eligible)
      trial = RunTrial(split_, Extended(before.free, extension, needed));

    const double turn_deg = ComparePoses(trial.scene, before.scene).rotation_max_deg;
    const bool is_radial = !extension.added.principal_point && !extension.added.tangential;
    const double min_fall = is_radial && turn_deg > kMaxTurnDeg ? 0 : extension.min_fall;
    const bool helps = n_needed > 0 && trial.held_out_px < (1 - min_fall) * before.held_out_px;
    const std::string figures = fmt::format(
        "{} {}: held-out error {:.4f} -> {:.4f} px{}, significant in {} of {} cameras, poses turn by {:.2g} "
        "deg",
        extension.Title(),
        helps ? "is needed" : "is not needed",
        before.held_out_px,
        trial.held_out_px,
        first < named.size() ? Figures(extension, trial, split_.training.scene, first) : "",
        n_needed,
        needed.size(),
        turn_deg);
    return {n_models, std::move(trial), std::move(needed), helps, figures};
  }

  static std::vector<FreeIntrinsics> Extended(std::vector<FreeIntrinsics> free,
                                              const CameraExtension& extension,
                                              const std::vector<bool>& cameras) {
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (cameras[i]) free[i] = Union(free[i], extension.added);
    }
    return free;
  }

  std::size_t LensOwner(std::size_t camera) const {
    return lens_of_[camera] < 0 ? camera : static_cast<std::size_t>(lens_of_[camera]);
  }

  std::vector<bool> EnoughObservations() const {
    std::vector<bool> enough;
    for (std::size_t i = 0; i < lens_of_.size(); ++i) {
      enough.push_back(lens_observations_[LensOwner(i)] >= kMinCameraObservations);
    }
    return enough;
  }

  // Returns whether there is any such focal length.
  bool HoldWeakFocals(const CameraTrial& trial) {
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
      decide_(fmt::format(
          "focal length of camera {} is held at {:.6g} px ({}): the pictures determine it to {:.2g} % only",
          i,
          camera.fl_x,
          known > 0 ? "known" : "a guess",
          100 * sigma));
    }
    return any;
  }

  const CameraModelOptions& options_;
  const Decide& decide_;
  const std::vector<int> lens_of_;
  ObservationSplit split_;
  std::vector<int> observations_, lens_observations_;  // per camera and lens, of the whole model
  std::vector<bool> focal_is_free_;
  std::string fixed_model_;  // empty: by need
};

// The camera model, in `model`, and the trial that was accepted. `model` may get a camera per picture.
CameraTrial SelectCameraModel(io::ColmapModel* model,
                              const CameraModelOptions& options,
                              const Decide& decide) {
  ForwardSelection shared(*model, std::vector(model->scene.cameras.size(), -1), options, decide);
  CameraTrial trial = shared.Select(&model->camera_model);
  if (options.camera_model != "auto" || !shared.CanCompare() ||
      model->scene.cameras.size() == model->scene.frames.size()) {
    return trial;
  }
  io::ColmapModel split = *model;
  for (std::size_t i = 0; i < trial.scene.cameras.size(); ++i) {
    split.scene.cameras[i].fl_x = trial.scene.cameras[i].fl_x;
    split.scene.cameras[i].fl_y = trial.scene.cameras[i].fl_y;
  }
  const auto [shared_camera, lens_of] = SplitCameras(&split.scene);
  CameraModelOptions split_options = options;
  split_options.known_focal_px.clear();
  ForwardSelection own(split, lens_of, split_options, decide);
  if (!own.OwnFocalsHelp(trial, shared_camera)) return trial;
  *model = std::move(split);
  return own.Select(&model->camera_model);
}

// The trial has adjusted the cameras with a part of the points. From there, all others moved to fit, few
// iterations remain.
AdjustmentReport AdjustFromTrial(const CameraTrial& trial, int threads, io::ColmapModel* model) {
  io::ColmapModel start = *model;
  start.scene.cameras = model->scene.cameras = trial.scene.cameras;
  start.scene.frames = trial.scene.frames;
  if (!AdjustPoints(&start, threads)) return AdjustBundle(model, {.free = trial.free, .title = kTitle});
  *model = std::move(start);
  return AdjustBundle(model, {.free = trial.free, .function_tolerance = kNearTolerance, .title = kTitle});
}

}  // namespace

SelectedCameraModel AdjustWithSelectedCameraModel(io::ColmapModel* model,
                                                  const CameraModelOptions& options,
                                                  const Decide& decide) {
  io::ColmapModel adjusted = *model;
  const CameraTrial trial = SelectCameraModel(&adjusted, options, decide);
  SelectedCameraModel selected{.camera_model = adjusted.camera_model, .free = trial.free};
  selected.adjustment = AdjustFromTrial(trial, options.threads, &adjusted);
  selected.uncertainty = EstimateUncertainty(adjusted, selected.free, true);
  selected.filter = RemoveWeakObservations(&adjusted);
  *model = std::move(adjusted);
  decide(
      fmt::format("camera model {}: {} iterations on {} observations, error {:.3f} px (RMS), {} observations "
                  "and {} points removed",
                  selected.camera_model,
                  selected.adjustment.iterations,
                  model->observations.size(),
                  selected.filter.rms_px,
                  selected.filter.removed_observations,
                  selected.filter.removed_points));
  return selected;
}

}  // namespace sfm
