#include "nerf/training/heldout_monitor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "io/base/random.h"
#include "nerf/rendering/splat_mixing.h"
#include "nerf/splatting/splat_rasteriser.h"

namespace nerf {
namespace {

constexpr int kPixels = 8192;
constexpr int kConstantPixels = 65536;
constexpr std::array<float, 3> kWhite = {1, 1, 1};

}  // namespace

HeldoutMonitor::HeldoutMonitor(const io::Scene& heldout, int threads, double pixel_offset)
    : heldout_(heldout) {
  if (heldout.frames.empty()) return;
  const Dataset layout = LayOutDataset(heldout, threads, pixel_offset);
  views_ = layout.views;
  const std::size_t n_used =
      layout.runs.empty() ? views_.back().first_pixel + views_.back().n_pixels() : layout.runs.size();
  std::vector<std::vector<std::size_t>> drawn(views_.size());  // places in pixels_
  for (std::uint64_t i = 0; i < kPixels; ++i) {
    const std::size_t pixel =
        layout.UsedPixel(io::Random(0, io::Stream::kMonitor, 0, i).Below(static_cast<std::uint32_t>(n_used)));
    const auto v = static_cast<std::size_t>(&layout.ViewOf(pixel) - layout.views.data());
    const View& view = views_[v];
    const int in_view = static_cast<int>(pixel - view.first_pixel);
    drawn[v].push_back(pixels_.size());
    pixels_.push_back({&view.camera, in_view % view.width, in_view / view.width});
  }
  target_.resize(3 * pixels_.size());
  has_alpha_ = ReadPictures(heldout, threads, [&](std::size_t v, const io::Image& image) {
    for (const std::size_t i : drawn[v]) {
      const std::uint8_t* p = image.Pixel(pixels_[i].x, pixels_[i].y);
      const float alpha = image.channels == 4 ? static_cast<float>(p[3]) / 255.f : 1.f;
      for (std::size_t j = 0; j < 3; ++j)
        target_[3 * i + j] = static_cast<float>(p[j]) / 255.f * alpha + (1.f - alpha);
    }
  });
}

// Splats have no single rays: every view that a pixel was drawn from is rendered whole.
void HeldoutMonitor::MixSplatsIn(const SceneField& scene_field,
                                 const std::vector<RenderedRay>& rendered,
                                 io::Workers* workers,
                                 std::vector<float>* rgb) const {
  SplatRasteriser rasteriser(workers);
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const io::Frame& frame = heldout_.frames[v];
    const io::Camera& camera = heldout_.cameras[static_cast<std::size_t>(frame.camera_index)];
    const SplatPicture splats = RenderSplats(scene_field, camera, frame.world_from_cam, {}, &rasteriser);
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      if (pixels_[i].camera != &views_[v].camera) continue;
      const auto at = static_cast<std::size_t>(pixels_[i].y * camera.width + pixels_[i].x);
      const Ray ray = pixels_[i].camera->RayThrough(pixels_[i].x, pixels_[i].y);
      const float share = SplatShareAt(scene_field, ray, rendered[i].median_depth);
      for (std::size_t c = 0; c < 3; ++c) {
        float* field = &(*rgb)[3 * i + c];
        const float over = splats.rgb[3 * at + c] + splats.transmittance[at] * *field;
        *field = MixedValue(*field, over, share);
      }
    }
  }
}

double HeldoutMonitor::Psnr(const SceneField& scene_field, io::Workers* workers) const {
  if (pixels_.empty()) return std::numeric_limits<double>::quiet_NaN();
  const std::vector<RenderedRay> rendered =
      RenderPixels(scene_field, pixels_, scene_field.samples_per_pixel, 1.f, workers);
  const std::array<float, 3> background = scene_field.Background(has_alpha_, kWhite);
  std::vector<float> rgb;
  for (const RenderedRay& ray : rendered) {
    for (std::size_t j = 0; j < 3; ++j)
      rgb.push_back(std::clamp(ray.rgb[j] + ray.transmittance * background[j], 0.f, 1.f));
  }
  if (scene_field.splats.size() > 0) MixSplatsIn(scene_field, rendered, workers, &rgb);
  double sum = 0;
  for (std::size_t i = 0; i < rgb.size(); ++i) {
    const double error = rgb[i] - target_[i];
    sum += error * error;
  }
  return -10 * std::log10(std::max(sum / static_cast<double>(target_.size()), 1e-12));
}

double ConstantSquaredError(const Dataset& dataset, double background) {
  double sum[3] = {}, squares[3] = {};
  for (std::uint64_t i = 0; i < kConstantPixels; ++i) {
    const std::size_t pixel = dataset.UsedPixel(
        io::Random(1, io::Stream::kMonitor, 0, i).Below(static_cast<std::uint32_t>(dataset.n_used())));
    const std::uint8_t* p = &dataset.pixels[pixel * static_cast<std::size_t>(dataset.channels)];
    const double alpha = dataset.channels == 4 ? p[3] / 255.0 : 1.0;
    for (int j = 0; j < 3; ++j) {
      const double value = p[j] / 255.0 * alpha + background * (1 - alpha);
      sum[j] += value;
      squares[j] += value * value;
    }
  }
  double variance = 0;
  for (int j = 0; j < 3; ++j)
    variance += squares[j] / kConstantPixels - sum[j] * sum[j] / kConstantPixels / kConstantPixels;
  return variance / 3;
}

}  // namespace nerf
