#include "pipeline/stages/film.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "io/base/error.h"
#include "io/base/interrupt.h"
#include "io/base/progress.h"
#include "io/image/colour_map.h"
#include "io/image/image.h"
#include "pipeline/stages/evaluation.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

// Below this, encoders refuse the picture or pad it.
constexpr int kMinSide = 32;

int EvenSide(double pixels) { return std::max(kMinSide, 2 * static_cast<int>(std::lround(pixels / 2))); }

// Depth in turbo colours between near and far, faded to black where rays leave the scene.
io::Image DepthPicture(const nerf::RenderedView& view, double near, double far) {
  std::vector<float> share(view.depth.size());
  for (std::size_t i = 0; i < share.size(); ++i) {
    share[i] = static_cast<float>((view.depth[i] - near) / (far - near));
  }
  io::Image picture = io::ApplyColourMap(share, view.width, view.height, io::ColourMap::kTurbo);
  for (std::size_t i = 0; i < picture.data.size(); ++i) {
    const float opacity = std::clamp(view.opacity[i / 3], 0.f, 1.f);
    picture.data[i] = static_cast<std::uint8_t>(std::lround(opacity * picture.data[i]));
  }
  return picture;
}

std::string PathDecision(const nerf::CameraPath& path) {
  char text[200];
  if (path.closed) {
    std::snprintf(text,
                  sizeof text,
                  "camera path: full orbit at distance %.2f, because cameras stood all around",
                  path.distance);
  } else {
    std::snprintf(
        text,
        sizeof text,
        "camera path: swing over %.0f degrees at distance %.2f, because no camera saw the other sides",
        path.arc_deg,
        path.distance);
  }
  return text;
}

}  // namespace

io::Camera FilmCamera(const io::Scene& train, int width) {
  const io::Camera& camera = train.cameras.at(train.frames.at(0).camera_index);
  const int even_width = EvenSide(width > 0 ? width : camera.width);
  const double scale = static_cast<double>(even_width) / camera.width;
  return io::ResizedCamera(camera, even_width, EvenSide(scale * camera.height));
}

Film RenderFilm(const nerf::TrainedField& field,
                const io::Scene& train,
                const FilmOptions& options,
                const fs::path& folder) {
  Film film;
  film.path = nerf::FitOrbit(train, options.frames);
  film.camera = FilmCamera(train, options.width);
  film.decisions.push_back(PathDecision(film.path));
  const io::VideoEncoder encoder = io::ProbeVideoEncoder(film.camera.width, film.camera.height, folder);
  film.decisions.push_back(encoder.decision);

  const fs::path frames = folder / "frames", depth_frames = folder / "depth_frames";
  nerf::RenderOptions render_options;
  render_options.step_scale = 1;  // in motion the finer interval is not seen, and it would double the wait
  render_options.threads = options.threads;
  render_options.samples_per_pixel = options.pixel_rays;
  io::Progress progress("render: film");
  std::chrono::duration<double> render_time(0);
  for (int i = 0; i < options.frames; ++i) {
    io::ThrowIfInterrupted();
    const fs::path frame = frames / io::VideoFrameName(i), depth_frame = depth_frames / io::VideoFrameName(i);
    const bool done = fs::is_regular_file(frame) && (!options.depth || fs::is_regular_file(depth_frame));
    if (!done) {
      const auto start = std::chrono::steady_clock::now();
      const nerf::RenderedView view = field.Render(film.camera, film.path.world_from_cam[i], render_options);
      render_time += std::chrono::steady_clock::now() - start;
      ++film.rendered;
      if (options.depth) io::WriteImage(depth_frame, DepthPicture(view, train.near, train.far));
      io::WriteImage(frame, QuantizeView(view));
    }
    progress.Update((i + 1.0) / options.frames);
  }
  if (film.rendered > 0) film.ms_per_frame = 1000 * render_time.count() / film.rendered;
  if (film.rendered < options.frames) {
    film.decisions.push_back(std::to_string(options.frames - film.rendered) +
                             " frames were on disk already and were kept");
  }
  film.videos.push_back(
      io::EncodeVideo(encoder, frames, options.frames, options.fps, folder / "novel_view.mp4"));
  if (options.depth) {
    film.videos.push_back(
        io::EncodeVideo(encoder, depth_frames, options.frames, options.fps, folder / "depth.mp4"));
  }
  return film;
}

}  // namespace pipeline
