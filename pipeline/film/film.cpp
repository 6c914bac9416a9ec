#include "pipeline/film/film.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "io/base/error.h"
#include "io/image/image.h"
#include "io/image/image_size.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "io/process/ranks.h"
#include "io/scene/transforms.h"
#include "nerf/data/capture_geometry.h"
#include "nerf/paths/even_path.h"
#include "nerf/paths/free_path.h"
#include "nerf/paths/path_ends.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/film/camera_path_file.h"
#include "pipeline/film/depth_picture.h"
#include "pipeline/film/film_check.h"
#include "pipeline/film/support_pictures.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using Seconds = std::chrono::duration<double>;

// Shortest and longest default film.
constexpr double kMinFilm_s = 6, kMaxFilm_s = 12;
// Speed of a walk in radians of picture motion per second: a picture of usual width is crossed in 2 s.
constexpr double kWalkSpeed = 0.5;
// Poses of the path before it is timed, eight per frame of the shortest default film: what is slowed down is
// made of several of them, and no corner is seen where they meet.
constexpr int kFewestPoses = 1440;
// Frames whose speed is tried, and, where there are no splats, the share of the film's sides: one or two
// hundredths of the film's time, or a thousandth.
constexpr int kTrialFrames = 3;
constexpr int kTrialScale = 4;
// Frames whose support is drawn for the report.
constexpr int kSupportFrames = 3;
// Longer side of their pictures: two and a half stand beside one another on a wide screen.
constexpr int kSupportSide = 480;

io::Camera CameraOfPath(const CameraPathFile& file) {
  return nerf::CameraOfView(file.width, file.height, file.frames.front().fov_y);
}

// Rendering a frame, with its depth and support beside it, or encoding all of them.
void RequireMemory(const io::Camera& camera, const FilmOptions& options) {
  constexpr int kMostRaysPerPixel = 4;  // that training sets
  const int rays = options.pixel_rays > 0 ? options.pixel_rays : kMostRaysPerPixel;
  options.memory.Require(
      std::max(nerf::RenderingBytes(camera, rays), io::EncodingBytes(camera.width, camera.height)),
      fmt::format("render: a film of {} x {}", camera.width, camera.height));
}

using Pictures = std::vector<std::pair<fs::path, io::Image>>;

struct FilmFrame {
  Pictures pictures;      // to write in this order: the frame itself last
  double ms = 0;          // that rendering it took; 0: it was there
  std::string thumbnail;  // for CheckFrames()
};

// Renders the frames of one film.
class FilmMaker {
 public:
  FilmMaker(const nerf::TrainedField& field,
            const io::Scene& train,
            const FilmOptions& options,
            const CameraPathFile* given_path,
            const std::optional<Crop>& crop,
            const fs::path& folder)
      : field_(field),
        train_(train),
        options_(options),
        given_path_(given_path),
        folder_(folder),
        support_(field, train, options.threads) {
    render_options_.step_scale = 1;  // in motion the finer interval is not seen, and it would double the wait
    render_options_.threads = options.threads;
    render_options_.samples_per_pixel = options.pixel_rays;
    if (!crop) return;
    render_options_.limits.crop = crop->box;
    render_options_.background = crop->background;
  }

  void FindPath(Film* film) const;
  void ChooseSize(Film* film) const;
  void WritePath(const Film& film) const;
  FilmFrame MakeFrame(int frame, const Film& film) const;

 private:
  double Expected_s(const Film& film) const;  // that rendering the frames takes
  void FitPath(Film* film) const;
  void TakePath(Film* film) const;
  io::Camera CameraOf(const Film& film, int frame) const {
    if (film.fov_y.empty()) return film.size.camera;
    return nerf::CameraOfView(
        film.size.camera.width, film.size.camera.height, film.fov_y[static_cast<std::size_t>(frame)]);
  }
  bool ShowsSplats() const { return field_.splats().size() > 0; }
  nerf::RenderOptions FrameOptions(const Film& film) const {
    nerf::RenderOptions options = render_options_;
    options.field_focal_px = film.size.field_share * nerf::LongestFocalLength(train_);
    return options;
  }
  fs::path FramePath(const char* kind, int frame) const { return folder_ / kind / io::VideoFrameName(frame); }
  bool IsSupportFrame(int frame, int frames) const {
    for (int k = 0; k < kSupportFrames; ++k) {
      if (frame == (2 * k + 1) * frames / (2 * kSupportFrames)) return true;
    }
    return false;
  }
  void AddSupport(int frame, const nerf::ViewSupport& support, const io::Image& picture, Pictures* all) const;

  const nerf::TrainedField& field_;
  const io::Scene& train_;
  const FilmOptions& options_;
  const CameraPathFile* given_path_;  // null: fitted to the capture
  const fs::path& folder_;
  const nerf::SupportMap support_;
  nerf::RenderOptions render_options_;
};

void FilmMaker::FindPath(Film* film) const { given_path_ ? TakePath(film) : FitPath(film); }

void FilmMaker::TakePath(Film* film) const {
  film->frames = static_cast<int>(given_path_->frames.size());
  for (const nerf::Keyframe& view : given_path_->frames) {
    film->path.world_from_cam.push_back(view.world_from_cam);
    film->fov_y.push_back(view.fov_y);
  }
  film->decisions.push_back("camera path: as given by " + options_.path.string());
}

void FilmMaker::FitPath(Film* film) const {
  film->frames = options_.frames;
  if (film->frames == 0) {
    const int shortest = static_cast<int>(std::ceil(kMinFilm_s * options_.fps));
    film->frames = DefaultFrames(nerf::FitCameraPath(train_, std::max(2, shortest)), options_.fps);
  }
  film->path = nerf::FitCameraPath(train_, std::max(kFewestPoses, film->frames));
  std::vector<io::Rigid3d> fitted = film->path.world_from_cam;
  film->decisions.push_back("camera path: " + nerf::Describe(film->path));
  const nerf::FreePathReport free = nerf::KeepFree(field_, train_, support_, options_.threads, &film->path);
  const nerf::CutEnds ends =
      nerf::CutWeakEnds(field_, train_, support_, options_.threads, &fitted, &film->path);
  if (ends.first + ends.last > 0)
    film->decisions.push_back(
        fmt::format("walk: {:.0f} and {:.0f} % at its ends are left out: one picture shows them",
                    100 * ends.first,
                    100 * ends.last));
  nerf::Retime(fitted, std::max(2, film->frames), &film->path);
  std::string line = fmt::format("free path: {} of {} poses were obstructed or looked where no picture did",
                                 free.obstructed,
                                 free.checked);
  if (free.obstructed > 0)
    line += fmt::format(", {} still after drawing the path towards the cameras", free.remaining);
  film->decisions.push_back(
      line + fmt::format("; never further than {:.0f} degrees of picture motion from a training view",
                         nerf::LargestDeparture(film->path, train_) * 180 / std::numbers::pi));
  for (std::string& check : CheckPath(film->path)) film->decisions.push_back(std::move(check));
}

double FilmMaker::Expected_s(const Film& film) const {
  // Under splats the field's part does not grow with the film.
  const int scale = ShowsSplats() ? 1 : kTrialScale;
  const io::Camera trial = EvenCamera(film.size.camera, static_cast<double>(film.size.camera.width) / scale);
  const auto start = std::chrono::steady_clock::now();
  for (int k = 0; k < kTrialFrames; ++k) {
    const auto pose = static_cast<std::size_t>((2 * k + 1) * film.frames / (2 * kTrialFrames));
    field_.Render(trial, film.path.world_from_cam[pose], FrameOptions(film));
  }
  const double pixels = static_cast<double>(film.size.camera.width) * film.size.camera.height,
               trial_pixels = static_cast<double>(trial.width) * trial.height;
  return Seconds(std::chrono::steady_clock::now() - start).count() * film.frames / kTrialFrames * pixels /
         trial_pixels;
}

void FilmMaker::ChooseSize(Film* film) const {
  if (options_.width > 0) return;
  if (const fs::path first = FramePath("frames", 0); fs::is_regular_file(first)) {
    film->size.camera = EvenCamera(film->size.camera, io::ReadImageSize(first).width);
    return;
  }
  const io::Camera& trained = train_.cameras.at(static_cast<std::size_t>(train_.frames.at(0).camera_index));
  const std::string line = KeepUnder(
      options_.ceiling_s, trained.width, ShowsSplats(), [&] { return Expected_s(*film); }, &film->size);
  if (!line.empty()) film->decisions.push_back(line);
}

void FilmMaker::WritePath(const Film& film) const {
  io::Scene scene;
  const int n_cameras = film.fov_y.empty() ? 1 : film.frames;
  for (int i = 0; i < n_cameras; ++i) scene.cameras.push_back(CameraOf(film, i));
  for (int i = 0; i < film.frames; ++i)
    scene.frames.push_back({FramePath("frames", i),
                            film.fov_y.empty() ? 0 : i,
                            film.path.world_from_cam[static_cast<std::size_t>(i)],
                            {}});
  io::WriteTransforms(folder_ / "camera_path.json", scene, "");
}

void FilmMaker::AddSupport(int frame,
                           const nerf::ViewSupport& support,
                           const io::Image& picture,
                           Pictures* all) const {
  const double scale =
      std::min(1.0, static_cast<double>(kSupportSide) / std::max(picture.width, picture.height));
  const int width = static_cast<int>(std::lround(scale * picture.width)),
            height = static_cast<int>(std::lround(scale * picture.height));
  const SupportPictures paths = SupportPicturePaths(folder_, frame);
  all->emplace_back(paths.picture, io::ResizeArea(picture, width, height));
  all->emplace_back(paths.angle, ViewAnglePicture(support, width, height));
  all->emplace_back(paths.views,
                    ViewCountPicture(support, static_cast<int>(train_.frames.size()), width, height));
}

FilmFrame FilmMaker::MakeFrame(int frame, const Film& film) const {
  const fs::path picture_path = FramePath("frames", frame), depth_path = FramePath("depth_frames", frame),
                 support_path = FramePath("support_frames", frame);
  const bool shows_support = IsSupportFrame(frame, film.frames);
  if (fs::is_regular_file(picture_path) && (!options_.depth || fs::is_regular_file(depth_path)) &&
      (!options_.support || fs::is_regular_file(support_path)) &&
      (!shows_support || fs::is_regular_file(SupportPicturePaths(folder_, frame).views)))
    return {.pictures = {}, .thumbnail = Thumbnail(io::ReadImage(picture_path))};
  const auto start = std::chrono::steady_clock::now();
  const io::Rigid3d& pose = film.path.world_from_cam[static_cast<std::size_t>(frame)];
  const io::Camera camera = CameraOf(film, frame);
  nerf::RenderedView view = field_.Render(camera, pose, FrameOptions(film));
  const bool unknown = field_.HasUnknownSpace();
  nerf::ViewSupport support;
  if (options_.support || shows_support) {
    support = support_.Of(camera, pose, view, options_.threads);
    if (render_options_.limits.crop) DropTransparent(view, &support);
  } else if (unknown) {
    support = support_.ObservedIn(camera, pose, view, options_.threads);
  }
  if (unknown) nerf::VeilUnobserved(support, kUnseenTone, render_options_.limits.crop.has_value(), &view);
  FilmFrame made{.pictures = {}, .ms = 1000 * Seconds(std::chrono::steady_clock::now() - start).count()};
  io::Image picture = QuantizeView(view);
  made.thumbnail = Thumbnail(picture);
  if (options_.depth) made.pictures.emplace_back(depth_path, DepthPicture(view, train_.near, train_.far));
  if (options_.support) {
    const int n_views = static_cast<int>(train_.frames.size());
    made.pictures.emplace_back(support_path, ViewCountPicture(support, n_views, view.width, view.height));
  }
  if (shows_support) AddSupport(frame, support, picture, &made.pictures);
  made.pictures.emplace_back(picture_path, std::move(picture));
  return made;
}

void WritePictures(const Pictures& pictures) {
  for (const auto& [path, picture] : pictures) io::WriteImage(path, picture);
}

// With several threads a frame is written while the next one is rendered.
void RenderFrames(const FilmMaker& maker, int threads, Film* film) {
  const std::launch how = threads > 1 ? std::launch::async : std::launch::deferred;
  std::future<void> writing;
  std::vector<double> ms(static_cast<std::size_t>(film->frames), 0);
  std::vector<std::string> thumbnails(ms.size());
  io::Progress progress("render: film");
  for (const std::size_t i : io::OwnTasks(ms.size())) {
    io::ThrowIfInterrupted();
    FilmFrame frame = maker.MakeFrame(static_cast<int>(i), *film);
    ms[i] = frame.ms;
    thumbnails[i] = std::move(frame.thumbnail);
    if (writing.valid()) writing.get();
    writing = std::async(how, WritePictures, std::move(frame.pictures));
    progress.Update((static_cast<double>(i) + 1) / film->frames);
  }
  if (writing.valid()) writing.get();
  io::GatherTasks(&ms);
  io::GatherTasks(&thumbnails);
  for (std::string& line : CheckFrames(thumbnails)) film->decisions.push_back(std::move(line));
  film->rendered = static_cast<int>(std::count_if(ms.begin(), ms.end(), [](double t) { return t > 0; }));
  if (film->rendered > 0) film->ms_per_frame = std::accumulate(ms.begin(), ms.end(), 0.0) / film->rendered;
}

}  // namespace

int DefaultFrames(const nerf::CameraPath& path, double fps) {
  const double walk_s = path.kind == nerf::PathKind::kWalk ? nerf::TotalMotion(path) / kWalkSpeed : 0;
  return std::max(2, static_cast<int>(std::ceil(std::clamp(walk_s, kMinFilm_s, kMaxFilm_s) * fps)));
}

Film RenderFilm(const nerf::TrainedField& field,
                const io::Scene& train,
                const FilmOptions& options,
                const fs::path& folder) {
  Film film;
  std::optional<CameraPathFile> given_path;
  if (!options.path.empty()) given_path = ReadCameraPath(options.path);
  std::optional<Crop> crop;
  if (given_path) crop = given_path->crop;
  if (!options.crop.empty()) crop = ReadCrop(options.crop);
  if (crop)
    film.decisions.push_back(fmt::format("crop box: {:.2f} x {:.2f} x {:.2f} scene units",
                                         crop->box.size.x(),
                                         crop->box.size.y(),
                                         crop->box.size.z()));
  film.fps = given_path ? given_path->fps : options.fps;
  film.size.camera =
      given_path ? EvenCamera(CameraOfPath(*given_path), options.width ? options.width : given_path->width)
                 : FilmCamera(train, options.width, options.photo_side);
  if (options.depth) film.size.field_share = 1;  // the edges of depths are the field's
  RequireMemory(film.size.camera, options);
  const bool leads = io::AllRanks().IsFirst();
  std::optional<io::VideoEncoder> encoder;
  if (leads) encoder = io::ProbeVideoEncoder(film.size.camera.width, film.size.camera.height, folder);
  const FilmMaker maker(field, train, options, given_path ? &*given_path : nullptr, crop, folder);
  maker.FindPath(&film);
  if (leads) maker.ChooseSize(&film);  // by its clock
  const int width = io::FromFirst(film.size.camera.width);
  film.size.field_share = io::FromFirst(film.size.field_share);
  if (leads) {
    film.decisions.push_back(encoder->decision);
    maker.WritePath(film);
  } else {
    film.size.camera = EvenCamera(film.size.camera, width);
  }
  RenderFrames(maker, options.threads, &film);
  if (!leads) return film;
  if (film.rendered < film.frames) {
    film.decisions.push_back(
        fmt::format("{} frames were on disk already and were kept", film.frames - film.rendered));
  }
  const auto encode = [&](const char* frames, const char* name) {
    film.videos.push_back(io::EncodeVideo(*encoder, folder / frames, film.frames, film.fps, folder / name));
  };
  encode("frames", "novel_view.mp4");
  if (options.depth) encode("depth_frames", "depth.mp4");
  if (options.support) encode("support_frames", "support.mp4");
  return film;
}

}  // namespace pipeline
