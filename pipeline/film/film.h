// The novel-view film: a path through observed space (nerf/paths/camera_path.h), rendered frame by frame
// and encoded.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "io/base/memory.h"
#include "io/scene/scene.h"
#include "io/video/video_writer.h"
#include "nerf/paths/camera_path.h"
#include "nerf/rendering/support_map.h"
#include "nerf/rendering/trained_field.h"
#include "pipeline/film/film_size.h"

namespace pipeline {

struct FilmOptions {
  int frames = 0;          // 0: 6 s of film, for a long walk up to 12 s
  double fps = 30;         // frames per second of the film
  int width = 0;           // pixels, rounded to even, as yuv420p needs; 0: see FilmCamera
  double ceiling_s = 180;  // what is drawn becomes smaller until it takes no longer; as long as training
  bool depth = false;      // also depth.mp4: distance along the ray, near blue to far red
  bool support = false;    // also support.mp4: number of training views that saw what a pixel shows
  int pixel_rays = 0;      // see nerf::RenderOptions
  int threads = 1;
  io::MemoryBudget memory = io::MemoryBudget();
  std::filesystem::path path;  // camera_path_file.h; empty: fitted to the capture
  std::filesystem::path crop;  // the same, for its crop box; empty: that of `path`, if any
  int photo_side = 0;  // longer side of the photos before they were made smaller for training; 0: unknown
};

struct Film {
  FilmSize size;
  nerf::CameraPath path;
  std::vector<double> fov_y;  // of each frame, when the path was given [radians]; else empty
  double fps = 0;
  int frames = 0;           // of the film
  int rendered = 0;         // of these, rendered now; the others were on disk already
  double ms_per_frame = 0;  // of those
  std::vector<io::VideoReport> videos;
  std::vector<std::string> decisions;
};

// Shown where no training view has observed anything, sRGB: darker than what pictures show, not quite black.
inline constexpr std::array<float, 3> kUnseenTone = {0.085f, 0.09f, 0.1f};

// Frames of a film along `path` for FilmOptions::frames = 0.
int DefaultFrames(const nerf::CameraPath& path, double fps);

// With options.path, its poses, angles of view, size and speed count as given; --size and the ceiling may
// make it smaller. Otherwise the path is fitted. Writes folder/novel_view.mp4 and folder/frames/000001.png
// ..., camera_path.json with the poses of the frames as a transforms.json, maps of the support of some frames
// in support/ (support_pictures.h), and depth.mp4, depth_frames/, support.mp4, support_frames/ on request.
// The encoder is tried before the first frame is rendered; frames that are on disk already are kept, so an
// interrupted or failed run continues where it stopped. Throws kMissingTool when no film can be encoded.
Film RenderFilm(const nerf::TrainedField& field,
                const io::Scene& train,
                const FilmOptions& options,
                const std::filesystem::path& folder);

}  // namespace pipeline
