// The first part of training: steps of a field, whatever its kind, and what is done when one goes wrong.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "nerf/data/near_cameras.h"
#include "nerf/fields/checkpoint.h"
#include "nerf/steps/camera_refinement.h"
#include "nerf/steps/field_training.h"
#include "nerf/steps/train_options.h"
#include "nerf/training/train_report.h"

namespace nerf {

class FieldFit {
 public:
  // All must outlive this; *options has the field's share of the budget. scene_field: as read from a
  // checkpoint with *state, or none to begin. Events are added to *report.
  FieldFit(const io::Scene& scene,
           const TrainOptions& options,
           std::unique_ptr<SceneField> scene_field,
           Dataset* dataset,
           TrainState* state,
           TrainReport* report,
           io::Workers* workers);

  // progress in [0, 1). Throws kNumeric when too many steps are not finite.
  void Step(double progress);

  SceneField* scene_field() const { return scene_field_.get(); }
  double loss() const { return loss_; }
  std::uint64_t n_rays() const { return n_rays_; }
  // The frames of the scene as training has moved them.
  std::vector<io::Rigid3d> WorldFromCam() const;
  // seconds: that the steps of this run took.
  void FillReport(double seconds) const;

 private:
  void MakeField();
  void MakeTraining();
  void Skip(const std::string& fault);
  bool HasCollapsed() const;
  void Restart();

  const io::Scene& scene_;
  const TrainOptions& options_;
  Dataset* const dataset_;
  TrainState* const state_;
  TrainReport* const report_;
  io::Workers* const workers_;
  std::unique_ptr<SceneField> scene_field_;
  std::optional<NearCameras> near_cameras_;     // of photographs ...
  std::optional<CameraRefinement> refinement_;  // ... whose cameras may move
  std::unique_ptr<FieldTraining> training_;
  double loss_ = 0, opacity_ = 0;
  double constant_squared_error_ = 0;
  std::uint64_t n_samples_ = 0, n_rays_ = 0;
  double flop_ = 0;
};

}  // namespace nerf
