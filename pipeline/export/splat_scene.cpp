#include "pipeline/export/splat_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/base/error.h"
#include "io/base/random.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "nerf/splatting/splat_optimizer.h"
#include "nerf/splatting/surface_splats.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/export/view_surface.h"

namespace pipeline {
namespace {

// Surfaces are looked for in pictures of this share of the side, which have far more pixels than are needed.
constexpr double kSurfaceShare = 0.5;
// Distance of the sky, in units of the scene's far: its splats hardly move between views.
constexpr double kSkyDistance = 50;
// Splats with more pixels that let most light pass than this share of a view's have left the sky out.
constexpr double kOpenShare = 0.01;
constexpr float kOpen = 0.5f;  // transmittance
// Side of a box larger than any scene, in units of far: rays end in it, and what lies behind is left out.
constexpr double kEverything = 1e4;

class SplatViews {
 public:
  SplatViews(const ExportedScene& scene, int view_size) : scene_(scene) {
    for (const io::Frame& frame : scene.train.frames) {
      const io::Camera& camera = scene.train.cameras[static_cast<std::size_t>(frame.camera_index)];
      const int side = view_size == 0 ? std::max(camera.width, camera.height) : view_size;
      const auto surface_side = std::max(1, static_cast<int>(kSurfaceShare * side));
      views_.push_back({nerf::SmallCamera(camera, side), frame.world_from_cam});
      surface_cameras_.push_back(nerf::SmallCamera(camera, surface_side));
    }
    limits_.crop = scene.crop;
    if (!scene.crop && !scene.field->HasUnknownSpace())
      limits_.crop = nerf::CropBox{.size = Eigen::Vector3d::Constant(kEverything * scene.train.far)};
  }

  std::size_t size() const { return views_.size(); }

  nerf::SplatTarget Target(std::size_t index) const {
    const nerf::SplatView& view = views_[index];
    const nerf::RenderedView picture = scene_.field->Render(
        view.camera,
        view.world_from_cam,
        {.threads = scene_.threads, .background = {0, 0, 0}, .limits = limits_, .splats = false});
    nerf::SplatTarget target{view, {}, {}};
    const auto put = [&](float value) {
      target.rgba.push_back(static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.f, 1.f))));
    };
    for (std::size_t i = 0; i < picture.opacity.size(); ++i) {
      for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) put(picture.rgb[c]);
      put(limits_.crop ? picture.opacity[i] : 1);
    }
    if (!limits_.crop) ShowPhoto(index, &target);
    return target;
  }

  // Pieces of surface at pixels chosen by chance, so that of all views' pixels about `number` are chosen.
  void AddPoints(std::size_t index, int number, std::vector<nerf::SurfacePoint>* points) const {
    AddPointsWhere([](std::size_t, bool) { return true; }, index, number, points);
  }

  // Likewise, of the sky alone and where `splats` let most light pass.
  void AddSky(const nerf::Splats& splats,
              std::size_t index,
              int number,
              nerf::SplatRasteriser* rasteriser,
              std::vector<nerf::SurfacePoint>* points) const {
    const std::vector<float> passes =
        rasteriser->Render(splats, {surface_cameras_[index], views_[index].world_from_cam}).transmittance;
    const auto n_open = std::count_if(passes.begin(), passes.end(), [](float t) { return t > kOpen; });
    if (static_cast<double>(n_open) < kOpenShare * static_cast<double>(passes.size())) return;
    AddPointsWhere(
        [&](std::size_t i, bool is_sky) { return is_sky && passes[i] > kOpen; }, index, number, points);
  }

 private:
  template <typename Wanted>
  void AddPointsWhere(const Wanted& wanted,
                      std::size_t index,
                      int number,
                      std::vector<nerf::SurfacePoint>* points) const {
    double n_pixels = 0;
    for (const io::Camera& camera : surface_cameras_) n_pixels += 1.0 * camera.width * camera.height;
    const io::Camera& camera = surface_cameras_[index];
    const io::Rigid3d& pose = views_[index].world_from_cam;
    const ViewSurface surface = MeasureSurface(scene_, camera, pose);
    const double footprint = nerf::PixelAngle(views_[index].camera);
    for (std::size_t i = 0; i < surface.distance.size(); ++i) {
      if (io::Random(0, io::Stream::kSplat, index, i).Uniform() * n_pixels >= number) continue;
      const bool is_sky = surface.distance[i] == 0;
      if ((is_sky && limits_.crop) || !wanted(i, is_sky)) continue;
      const double distance = is_sky ? kSkyDistance * scene_.train.far : surface.distance[i];
      const Eigen::Vector3f ray = surface.rays[i].cast<float>(), normal = surface.normals[i];
      points->push_back({.position = (pose.translation + distance * surface.rays[i]).cast<float>(),
                         .normal = normal.isZero() ? Eigen::Vector3f(-ray) : normal,
                         .rgb = Eigen::Vector3f(&surface.rgb[3 * i]),
                         .footprint = static_cast<float>(distance * footprint)});
    }
  }

  // Puts the photo where its mask uses it.
  void ShowPhoto(std::size_t index, nerf::SplatTarget* target) const {
    const int width = target->view.camera.width, height = target->view.camera.height;
    Truth truth = ReadTruth(scene_.train.frames[index]);
    if (truth.picture.width != width || truth.picture.height != height) {
      truth.picture = io::ResizeArea(truth.picture, width, height);
      if (!truth.mask.used.empty()) truth.mask = io::ShrinkMask(truth.mask, width, height);
    }
    for (std::size_t i = 0; i < target->rgba.size() / 4; ++i) {
      if (truth.mask.Uses(i)) std::copy_n(&truth.picture.data[3 * i], 3, &target->rgba[4 * i]);
    }
  }

  const ExportedScene& scene_;
  std::vector<nerf::SplatView> views_;
  std::vector<io::Camera> surface_cameras_;
  nerf::RayLimits limits_;
};

}  // namespace

nerf::Splats MakeSplats(const ExportedScene& scene, const SplatSceneOptions& options) {
  const SplatViews views(scene, options.view_size);
  std::vector<nerf::SplatTarget> targets;
  std::vector<nerf::SurfacePoint> points;
  {
    io::Progress progress("views for splats");
    for (std::size_t i = 0; i < views.size(); ++i) {
      io::ThrowIfInterrupted();
      views.AddPoints(i, options.max_splats, &points);
      targets.push_back(views.Target(i));
      progress.Update(static_cast<double>(i + 1) / static_cast<double>(views.size()));
    }
  }
  if (points.empty())
    throw io::Error(io::ExitCode::kBadState,
                    scene.folder.parent_path().string() + ": the training views show no surface" +
                        (scene.crop ? " in the crop box" : ""),
                    scene.crop ? "Move the box" : "Train longer, or photograph more views");
  nerf::Splats splats = nerf::SplatsOn(points);
  io::Progress progress("splats");
  const auto show = [&](double share, double psnr_db) {
    progress.Update(share, fmt::format("{:.1f} dB", psnr_db));
  };
  nerf::OptimizeSplats(
      targets, {.steps = options.steps, .threads = scene.threads, .progress = show}, &splats);
  return splats;
}

nerf::Splats WithSky(const ExportedScene& scene,
                     const nerf::Splats& splats,
                     const SplatSceneOptions& options) {
  if (!scene.field->HasUnknownSpace()) return splats;
  const SplatViews views(scene, options.view_size);
  io::Workers workers(scene.threads);
  nerf::SplatRasteriser rasteriser(&workers);
  std::vector<nerf::SurfacePoint> points;
  for (std::size_t i = 0; i < views.size(); ++i) {
    io::ThrowIfInterrupted();
    views.AddSky(splats, i, options.max_splats, &rasteriser, &points);
  }
  if (points.empty()) return splats;
  nerf::Splats all = splats;
  const nerf::Splats sky = nerf::SplatsOn(points);
  const auto append = [](const std::vector<float>& more, std::vector<float>* values) {
    values->insert(values->end(), more.begin(), more.end());
  };
  append(sky.places, &all.places), append(sky.log_scales, &all.log_scales);
  append(sky.rotations, &all.rotations), append(sky.opacities, &all.opacities);
  append(sky.colours, &all.colours);
  return all;
}

}  // namespace pipeline
