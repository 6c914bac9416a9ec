// Samples per pixel, exposure, sRGB curve and sensor noise.
#include "samples/photograph.h"

#include <algorithm>
#include <cmath>

#include "io/base/check.h"
#include "io/process/parallel.h"
#include "samples/noise.h"

namespace samples {
namespace {

double SrgbFromLinear(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

std::uint8_t Quantised(double linear, double noise) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(255 * SrgbFromLinear(linear) + noise, 0.0, 255.0)));
}

// Hammersley points: no two samples of a pixel share a row or a column, so that edges of every slope are
// smooth.
Eigen::Vector2d SampleInPixel(int s, int samples) {
  double reversed = 0, digit = 0.5;
  for (int bits = s; bits > 0; bits >>= 1, digit *= 0.5) reversed += digit * (bits & 1);
  return {(s + 0.5) / samples, reversed + 0.5 / samples};
}

}  // namespace

Photographer::Photographer(const io::Camera& camera, int samples, int threads)
    : camera_(camera), samples_(samples), threads_(threads) {
  const auto rows = static_cast<std::size_t>(camera.height),
             row_rays = static_cast<std::size_t>(std::ptrdiff_t{camera.width} * samples);
  rays_.resize(rows * row_rays);
  io::ParallelFor(rows, threads, [&](std::size_t y) {
    std::size_t i = y * row_rays;
    for (int x = 0; x < camera.width; ++x) {
      for (int s = 0; s < samples; ++s) {
        const auto ray = io::RayFromImg(camera, Eigen::Vector2d(x, y) + SampleInPixel(s, samples));
        PIPELINE_CHECK(ray.has_value());
        rays_[i++] = ray->cast<float>();
      }
    }
  });
}

io::Image Photographer::Take(const StillLife& scene,
                             const std::vector<io::Rigid3d>& poses,
                             const Exposure& exposure) const {
  io::Image image = io::MakeImage(camera_.width, camera_.height, 3);
  const auto per_pixel = static_cast<std::size_t>(samples_);
  const double pixel_angle = 1 / (camera_.fl_x * std::sqrt(samples_));
  const double gain = std::exp2(exposure.ev) / static_cast<double>(per_pixel * poses.size());
  io::ParallelFor(static_cast<std::size_t>(camera_.height), threads_, [&](std::size_t y) {
    const Eigen::Vector3f* rays = &rays_[y * static_cast<std::size_t>(camera_.width * samples_)];
    for (int x = 0; x < camera_.width; ++x, rays += samples_) {
      Vec3 sum = Vec3::Zero();
      for (const io::Rigid3d& pose : poses) {
        for (std::size_t s = 0; s < per_pixel; ++s) {
          const Vec3 direction = (pose.rotation * rays[s].cast<double>()).normalized();
          // Each sample is what the sensor can hold: a highlight of many whites must not outshine its pixel's
          // edge.
          sum += scene.Radiance(pose.translation, direction, pixel_angle).cwiseMin(1.5);
        }
      }
      for (int c = 0; c < 3; ++c) {
        const double noise =
            exposure.noise_sigma * NormalHash(3 * x + c, static_cast<std::int64_t>(y), exposure.noise_seed);
        image.Pixel(x, y)[c] = Quantised(gain * sum[c], noise);
      }
    }
  });
  return image;
}

std::vector<float> Photographer::TakeDepth(const StillLife& scene, const io::Rigid3d& world_from_cam) const {
  std::vector<float> depth(static_cast<std::size_t>(std::ptrdiff_t{camera_.width} * camera_.height));
  io::ParallelFor(static_cast<std::size_t>(camera_.height), threads_, [&](std::size_t y) {
    float* row = &depth[y * static_cast<std::size_t>(camera_.width)];
    for (int x = 0; x < camera_.width; ++x) {
      const Vec3 ray = io::RayFromImg(camera_, {x + 0.5, y + 0.5}).value();
      row[x] = static_cast<float>(scene.Depth(world_from_cam.translation, world_from_cam.rotation * ray));
    }
  });
  return depth;
}

}  // namespace samples
