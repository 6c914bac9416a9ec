// Turns the scene into a digital photograph: lens, exposure, motion, sensor.
#pragma once

#include <vector>

#include "io/image/image.h"
#include "io/scene/scene.h"
#include "samples/still_life.h"

namespace samples {

struct Exposure {
  double ev = 0;                 // exposure value: linear light is multiplied by 2^ev
  double noise_sigma = 0;        // of the sensor, in 1/255 of white after sRGB encoding
  std::uint64_t noise_seed = 1;  // each photograph its own
};

// A camera whose rays are worked out once for all photographs.
class Photographer {
 public:
  // samples: rays per pixel, spread over its area. Throws kInternal when a pixel has no ray (distortion folds
  // back).
  Photographer(const io::Camera& camera, int samples, int threads);

  // poses: world_from_cam (OpenGL axes) at equal time steps while the shutter was open; one pose: no motion
  // blur. The result is the same for any number of threads.
  io::Image Take(const StillLife& scene,
                 const std::vector<io::Rigid3d>& poses,
                 const Exposure& exposure) const;

  // Distance along the ray through each pixel centre, [height][width], scene units.
  std::vector<float> TakeDepth(const StillLife& scene, const io::Rigid3d& world_from_cam) const;

 private:
  io::Camera camera_;
  int samples_, threads_;
  std::vector<Eigen::Vector3f> rays_;  // [height][width][samples], camera axes, unit length
};

}  // namespace samples
