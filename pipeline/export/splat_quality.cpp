#include "pipeline/export/splat_quality.h"

#include <algorithm>
#include <vector>

#include "io/process/parallel.h"
#include "nerf/metrics/metrics.h"
#include "nerf/splatting/plain_rasteriser.h"
#include "pipeline/evaluation/evaluation.h"

namespace pipeline {
namespace {

// Views to measure at most, evenly spread: NeRF-synthetic scenes have two hundred.
constexpr std::size_t kMostViews = 16;
// Of RGBA photos, as evaluation has it.
constexpr std::array<float, 3> kWhite = {1, 1, 1};

SplatQuality MeasureView(const ExportedScene& scene, const nerf::Splats& splats, const io::Frame& frame) {
  const io::Camera& camera = scene.test.cameras[static_cast<std::size_t>(frame.camera_index)];
  const auto [truth, mask] = ReadTruth(frame);
  const std::array<float, 3> shown = scene.field->Background(kWhite);
  const std::vector<double> rgb =
      nerf::RenderPlainly(splats, {camera, frame.world_from_cam}, {shown[0], shown[1], shown[2]});
  const nerf::RenderedView view{
      .width = camera.width, .height = camera.height, .rgb = {rgb.begin(), rgb.end()}};
  const io::Image picture = QuantizeView(view);
  const io::Image field =
      QuantizeView(scene.field->Render(camera, frame.world_from_cam, {.threads = 1, .splats = false}));
  const auto psnr = [&mask = mask](const io::Image& a, const io::Image& b) {
    return nerf::PsnrFromMse(nerf::MeanSquaredError(a, b, mask));
  };
  return {1, psnr(truth, picture), psnr(truth, field), psnr(field, picture)};
}

}  // namespace

std::optional<SplatQuality> MeasureSplats(const ExportedScene& scene, const nerf::Splats& splats) {
  const std::vector<io::Frame>& frames = scene.test.frames;
  if (frames.empty() || scene.crop) return std::nullopt;
  std::vector<SplatQuality> of_view(std::min(frames.size(), kMostViews));
  io::ParallelFor(of_view.size(), scene.threads, [&](std::size_t i) {
    of_view[i] = MeasureView(scene, splats, frames[i * frames.size() / of_view.size()]);
  });
  SplatQuality mean{.views = static_cast<int>(of_view.size())};
  const auto n = static_cast<double>(of_view.size());
  for (const SplatQuality& view : of_view) {
    mean.splats_db += view.splats_db / n, mean.field_db += view.field_db / n;
    mean.apart_db += view.apart_db / n;
  }
  return mean;
}

}  // namespace pipeline
