// The novel-view film: an orbit through observed space, rendered frame by frame and encoded.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/scene/scene.h"
#include "io/video/video_writer.h"
#include "nerf/rendering/camera_path.h"
#include "nerf/rendering/trained_field.h"

namespace pipeline {

struct FilmOptions {
  int frames = 120;
  double fps = 30;     // frames per second of the film
  int width = 0;       // pixels; 0: that of the training pictures. Rounded to even, as yuv420p needs
  bool depth = false;  // also depth.mp4: distance along the ray, near blue to far red
  int pixel_rays = 0;  // see nerf::RenderOptions
  int threads = 1;
};

struct Film {
  io::Camera camera;
  nerf::CameraPath path;
  int rendered = 0;         // frames rendered now; the others were on disk already
  double ms_per_frame = 0;  // of those
  std::vector<io::VideoReport> videos;
  std::vector<std::string> decisions;
};

// The camera of the film: the first training camera, resized to even width and height.
io::Camera FilmCamera(const io::Scene& train, int width);

// Writes folder/novel_view.mp4 and folder/frames/000001.png ... (and depth.mp4, depth_frames/). The encoder
// is tried before the first frame is rendered; frames that are on disk already are kept, so an interrupted or
// failed run continues where it stopped. Throws kMissingTool when no film can be encoded.
Film RenderFilm(const nerf::TrainedField& field,
                const io::Scene& train,
                const FilmOptions& options,
                const std::filesystem::path& folder);

}  // namespace pipeline
