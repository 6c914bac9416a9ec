// Quality while training: that of held-out pixels, and the error of the best constant picture, which a field
// beats unless its training has collapsed.
#pragma once

#include <vector>

#include "io/scene/scene.h"
#include "nerf/data/dataset.h"
#include "nerf/rendering/ray_renderer.h"

namespace nerf {

class HeldoutMonitor {
 public:
  // Draws 8192 fixed random used pixels of the held-out pictures; none when the scene has no frames. heldout
  // must outlive this.
  HeldoutMonitor(const io::Scene& heldout, int threads, double pixel_offset);

  // PSNR over those pixels, on white for pictures with alpha; NaN without held-out pictures.
  double Psnr(const SceneField& scene_field, io::Workers* workers) const;

 private:
  void MixSplatsIn(const SceneField& scene_field,
                   const std::vector<RenderedRay>& rendered,
                   io::Workers* workers,
                   std::vector<float>* rgb) const;

  const io::Scene& heldout_;
  std::vector<View> views_;
  std::vector<CameraPixel> pixels_;  // of views_
  std::vector<float> target_;        // [n][3], those with alpha composited on white
  bool has_alpha_ = false;
};

// Mean squared error per channel, on the given background, of the constant picture that fits the used
// training pixels best.
double ConstantSquaredError(const Dataset& dataset, double background);

}  // namespace nerf
