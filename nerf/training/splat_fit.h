// The second part of training on photographs: splats, begun on the surfaces that the field shows, are fitted
// to the photographs, and both are mixed in the picture (nerf/rendering/splat_mixing.h).
//
// Splats can learn few pictures by heart. A referee tells: one picture in kJudgedEvery is set aside until
// half of the fit. The worse the splats fare on those than on their neighbours, the less they count in the
// picture.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "nerf/fields/checkpoint.h"
#include "nerf/splatting/splat_optimizer.h"
#include "nerf/training/splat_photos.h"

namespace nerf {

// Of the training time, that the field has; the rest is the splats'.
inline constexpr double kFieldShare = 0.5;
// Of a training by steps: steps of the field for each of the splats.
inline constexpr int kFieldSteps = 10;
// Pictures for each one that is set aside: fewer cannot be judged, and get no splats.
inline constexpr std::size_t kJudgedEvery = 8;

class SplatFit {
 public:
  // Opaque pictures, and enough of them for the referee.
  static bool Suits(const Dataset& dataset, FieldKind kind) {
    return kind == FieldKind::kHash && dataset.channels == 3 && dataset.views.size() >= kJudgedEvery;
  }

  // Used pixels of all pictures to the number of splats, and the bytes that fitting them takes.
  static std::size_t Number(std::size_t n_pixels);
  static std::size_t Bytes(std::size_t n_pixels);

  // All must outlive this. The frames of `scene` are the views of `dataset`, RGB; world_from_cam: theirs, as
  // the field saw them. Continues what is in scene_field and state, or begins.
  SplatFit(const io::Scene& scene,
           const Dataset& dataset,
           std::vector<io::Rigid3d> world_from_cam,
           SceneField* scene_field,
           TrainState* state,
           io::Workers* workers);

  // One picture. progress in [0, 1). Results are the same for any number of threads.
  void Step(double progress);
  // Ends the fit: nothing is kept but the splats, and these only if they count for something; and decides
  // whether what hides them is a floater of the field. Returns what became of them.
  std::string Finish();

 private:
  void Begin();
  double SquaredError(std::size_t view);
  void Judge();
  void ChooseShare();

  const Dataset& dataset_;
  const SplatPhotos photos_;
  SceneField* const scene_field_;
  TrainState* const state_;
  io::Workers* const workers_;
  std::vector<std::size_t> fitted_, aside_;  // views
  std::optional<SplatAdam> adam_;
};

}  // namespace nerf
