// One ray through a sampler.
#pragma once

#include "nerf/sampling/sampler.h"

namespace nerf {

// Up to max_samples samples from *t on, which advances.
inline Samples MarchRay(const Sampler& sampler, const Ray& ray, float t_last, int max_samples, float* t) {
  MarchingRays rays;
  Samples samples;
  sampler.AddRay(ray, *t, t_last, &rays);
  sampler.March(1, max_samples, &rays, &samples);
  *t = rays.t[0];
  return samples;
}

}  // namespace nerf
