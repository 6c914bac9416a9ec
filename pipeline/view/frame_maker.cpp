#include "pipeline/view/frame_maker.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <limits>
#include <thread>

#include "io/image/colour_map.h"
#include "io/image/image.h"
#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "io/process/resource_meter.h"
#include "io/process/stopwatch.h"
#include "nerf/data/capture_geometry.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/film/depth_picture.h"
#include "pipeline/film/film.h"
#include "pipeline/film/support_pictures.h"

namespace pipeline {
namespace {

using Clock = std::chrono::steady_clock;

// Pixels between two looks at whether the picture is still wanted: some 50 ms of one core.
constexpr int kBandPixels = 1 << 14;
// While a hand moves, the sides of the field's picture under splats, as a share of those of the picture or,
// if these are smaller, of the training pictures (nerf/EXPERIMENTS.md, Rendering).
constexpr double kMovingFieldShare = 0.35;
// Of what training gives up, the processor time of frames is so much. The rest goes to checkpoints for them,
// written and read, and to threads of a training step that wait for one which a frame holds up.
constexpr double kFramesShare = 0.5;
constexpr auto kTurnStep = std::chrono::milliseconds(5);

// On threads that give way to the others.
void RunBeside(const std::function<void()>& part) {
  std::async(std::launch::async, [&] {
    io::GiveWay();
    part();
  }).get();
}

double Now_s() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

nerf::RenderOptions OptionsOf(const FrameRequest& request, const io::Scene& scene, int threads) {
  nerf::RenderOptions options;
  options.threads = threads;
  options.splats = request.layer == ViewLayer::kColour;
  const double trained_px = nerf::LongestFocalLength(scene);
  options.field_focal_px = nerf::kFieldPictureShare * trained_px;
  if (request.quality != ViewQuality::kFinest) {
    options.step_scale = 1;
    options.samples_per_pixel = 1;
  }
  if (request.quality == ViewQuality::kFast)
    options.field_focal_px = kMovingFieldShare * std::min(trained_px, request.camera.fl_x);
  if (request.crop) {
    options.limits.crop = request.crop->box;
    options.background = request.crop->background;
  }
  return options;
}

// Rows [begin, end) of the camera's picture.
io::Camera Band(io::Camera camera, int begin, int end) {
  camera.height = end - begin;
  camera.cy -= begin;
  return camera;
}

void Append(const nerf::RenderedView& band, nerf::RenderedView* view) {
  view->width = band.width;
  view->height += band.height;
  view->rgb.insert(view->rgb.end(), band.rgb.begin(), band.rgb.end());
  view->depth.insert(view->depth.end(), band.depth.begin(), band.depth.end());
  view->opacity.insert(view->opacity.end(), band.opacity.begin(), band.opacity.end());
  view->unlearnt.insert(view->unlearnt.end(), band.unlearnt.begin(), band.unlearnt.end());
}

// What the layer shows of a rendered view.
io::Image Picture(const FrameRequest& request,
                  const LiveRun::Content& content,
                  nerf::RenderedView* view,
                  int threads) {
  if (request.layer == ViewLayer::kDepth) return DepthPicture(*view, content.scene->near, content.scene->far);
  if (!content.support || !content.field) return QuantizeView(*view);
  if (request.layer == ViewLayer::kSupport) {
    const auto support = content.support->Of(request.camera, request.world_from_cam, *view, threads);
    return ViewCountPicture(
        support, static_cast<int>(content.scene->frames.size()), view->width, view->height);
  }
  if (!content.field->HasUnknownSpace()) return QuantizeView(*view);
  if (request.quality == ViewQuality::kFast) {
    nerf::VeilUnlearnt(kUnseenTone, view);
  } else {  // as the film has it, which takes longer
    const auto support = content.support->ObservedIn(request.camera, request.world_from_cam, *view, threads);
    nerf::VeilUnobserved(support, kUnseenTone, request.crop.has_value(), view);
  }
  return QuantizeView(*view);
}

}  // namespace

nerf::RenderedView RenderPoints(const std::vector<io::Point3D>& points,
                                const io::Camera& camera,
                                const io::Rigid3d& world_from_cam) {
  nerf::RenderedView view{.width = camera.width, .height = camera.height};
  const std::size_t n = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  view.rgb.resize(3 * n);
  for (std::size_t i = 0; i < view.rgb.size(); ++i) view.rgb[i] = kUnseenTone[i % 3];
  view.depth.assign(n, std::numeric_limits<float>::infinity());
  view.opacity.assign(n, 0);
  const int side = std::max(1, camera.height / 250);  // a point's, [px]
  const io::Rigid3d cam_from_world = world_from_cam.Inverse();
  for (const io::Point3D& point : points) {
    const Eigen::Vector3d x = cam_from_world * point.xyz;
    const auto xy = io::ImgFromCam(camera, x);
    if (!xy || !(xy->cwiseAbs().maxCoeff() < 1e6)) continue;
    const int left = static_cast<int>(std::floor(xy->x())) - side / 2,
              top = static_cast<int>(std::floor(xy->y())) - side / 2;
    const float depth = static_cast<float>(x.norm());
    for (int v = std::max(0, top); v < std::min(camera.height, top + side); ++v) {
      for (int u = std::max(0, left); u < std::min(camera.width, left + side); ++u) {
        const auto pixel = static_cast<std::size_t>(v) * static_cast<std::size_t>(camera.width) +
                           static_cast<std::size_t>(u);
        if (depth >= view.depth[pixel]) continue;
        view.depth[pixel] = depth;
        view.opacity[pixel] = 1;
        for (std::size_t c = 0; c < 3; ++c)
          view.rgb[3 * pixel + c] = static_cast<float>(point.rgb[c]) / 255.f;
      }
    }
  }
  for (float& depth : view.depth) depth = std::isfinite(depth) ? depth : 0;
  return view;
}

void FrameMaker::NoteRequest(const FrameRequest& request) {
  // Pages that were closed long ago need no entry.
  constexpr std::size_t kMostViewers = 1000;
  const std::lock_guard lock(latest_mutex_);
  if (latest_.size() > kMostViewers) latest_.clear();
  std::uint64_t& latest = latest_[request.viewer];
  latest = std::max(latest, request.sequence);
}

bool FrameMaker::IsWanted(const FrameRequest& request) const {
  io::ThrowIfInterrupted();
  const std::lock_guard lock(latest_mutex_);
  const auto latest = latest_.find(request.viewer);
  return latest == latest_.end() || latest->second <= request.sequence;
}

nerf::RenderedView FrameMaker::Render(const FrameRequest& request,
                                      const LiveRun::Content& content,
                                      int threads) {
  if (!content.field) return RenderPoints(content.scene->points, request.camera, request.world_from_cam);
  return content.field->Render(
      request.camera, request.world_from_cam, OptionsOf(request, *content.scene, threads));
}

bool FrameMaker::InTurn(const FrameRequest& request,
                        const LiveRun::Content& content,
                        const std::function<void()>& part) {
  const std::lock_guard lock(render_mutex_);
  while (IsWanted(request) && Now_s() < not_before_s_) std::this_thread::sleep_for(kTurnStep);
  if (!IsWanted(request)) return false;
  const double begin_s = Now_s(), cpu_begin_s = io::ProcessCpuSeconds();
  if (!content.is_training) {
    part();
  } else {
    RunBeside(part);
    const double held_s = (io::ProcessCpuSeconds() - cpu_begin_s) / threads_;
    not_before_s_ = begin_s + held_s / (kFramesShare * training_share_);
  }
  return true;
}

std::optional<nerf::RenderedView> FrameMaker::RenderInTurns(const FrameRequest& request,
                                                            const LiveRun::Content& content) {
  const nerf::RenderOptions options = OptionsOf(request, *content.scene, threads_);
  nerf::RenderOptions of_bands = options;
  of_bands.splats = false;
  const io::Camera camera = content.field->FieldCamera(request.camera, options);
  const int rows = std::max(1, kBandPixels / camera.width);
  nerf::RenderedView view;
  for (int begin = 0; begin < camera.height; begin += rows) {
    const int end = std::min(camera.height, begin + rows);
    if (!InTurn(request, content, [&] {
          Append(content.field->Render(Band(camera, begin, end), request.world_from_cam, of_bands), &view);
          if (end == camera.height)
            content.field->AddSplats(request.camera, request.world_from_cam, options, &view);
        }))
      return std::nullopt;
  }
  return view;
}

std::optional<ViewFrame> FrameMaker::Make(const FrameRequest& request, const LiveRun::Content& content) {
  if (!content.scene) return std::nullopt;
  NoteRequest(request);
  const io::Stopwatch stopwatch;
  std::optional<nerf::RenderedView> view;
  if (content.field) {
    view = RenderInTurns(request, content);
  } else {
    InTurn(request, content, [&] { view = Render(request, content, threads_); });
  }
  if (!view) return std::nullopt;
  return ViewFrame{.jpeg = io::EncodeImage(Picture(request, content, &*view, threads_), ".jpg"),
                   .render_ms = 1000 * stopwatch.seconds()};
}

}  // namespace pipeline
