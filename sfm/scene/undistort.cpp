#include "sfm/scene/undistort.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "io/base/error.h"
#include "io/base/packed.h"
#include "io/image/image.h"
#include "io/image/mask.h"
#include "io/image/resample.h"
#include "io/process/parallel.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

// Between two samples of the border a smooth distortion deviates from a line by far less than a pixel.
constexpr int kBorderSamples = 200;

// Where each pixel of the pinhole camera comes from in the pictures of `camera`.
struct PixelMap {
  io::Camera camera;
  io::PixelSources sources;
};

PixelMap MapToPinhole(const io::Camera& camera) {
  const io::Camera pinhole = PinholeCamera(camera);
  PixelMap map{camera, io::PixelSources(pinhole.width, pinhole.height)};
  for (int row = 0, i = 0; row < pinhole.height; ++row) {
    for (int column = 0; column < pinhole.width; ++column, ++i) {
      const auto ray = io::RayFromImg(pinhole, {column + 0.5, row + 0.5});
      const auto source = io::ImgFromCam(camera, *ray);
      map.sources.x[static_cast<std::size_t>(i)] = static_cast<float>(source->x());
      map.sources.y[static_cast<std::size_t>(i)] = static_cast<float>(source->y());
    }
  }
  return map;
}

// One map per thread: a scene may have a camera per picture, and neighbours usually share theirs.
const io::PixelSources& CachedSources(const io::Camera& camera) {
  thread_local PixelMap map;
  if (map.camera != camera) map = MapToPinhole(camera);
  return map.sources;
}

// Names inside the target folder, one per frame, without repetition.
std::vector<std::string> TargetNames(const io::Scene& scene) {
  std::vector<std::string> names;
  std::set<std::string> stems;
  for (const io::Frame& frame : scene.frames) {
    const bool resampled = scene.cameras[static_cast<std::size_t>(frame.camera_index)].HasDistortion();
    const std::string extension = resampled ? ".png" : frame.image_path.extension().string();
    const std::string original = frame.image_path.stem().string();
    std::string stem = original;
    for (int i = 2; !stems.insert(stem).second; ++i) stem = fmt::format("{}_{}", original, i);
    names.push_back(stem + extension);
  }
  return names;
}

// A frame's files, relative to the target folder; without a mask both of its names are empty.
struct FrameFiles {
  io::Camera camera;
  std::string image, new_image, mask, new_mask;
};

void WriteImageOf(const io::Camera& camera, const fs::path& source, const fs::path& target) {
  const io::Image image = io::ReadImage(source);
  if (image.width != camera.width || image.height != camera.height) {
    throw io::Error(io::ExitCode::kBadInput,
                    fmt::format("{}: is {}x{} but its camera is {}x{}",
                                source.string(),
                                image.width,
                                image.height,
                                camera.width,
                                camera.height),
                    "Use the pictures that the poses were made from");
  }
  if (camera.HasDistortion()) {
    io::WriteImage(target, io::Resample(image, CachedSources(camera)));
  } else {
    fs::copy_file(source, target, fs::copy_options::overwrite_existing);
  }
}

void WriteMaskOf(const io::Camera& camera, const fs::path& source, const fs::path& target) {
  const io::Mask mask = io::ReadMask(source, camera.width, camera.height);
  io::WriteMask(target, camera.HasDistortion() ? io::Resample(mask, CachedSources(camera)) : mask);
}

io::TaskResults WriteSome(const std::vector<FrameFiles>& frames,
                          const fs::path& folder,
                          int threads,
                          const std::vector<std::size_t>& tasks) {
  const auto path = [&](const std::string& name) { return (folder / name).lexically_normal(); };
  io::ParallelFor(tasks.size(), threads, [&](std::size_t i) {
    const FrameFiles& frame = frames[tasks[i]];
    WriteImageOf(frame.camera, path(frame.image), path(frame.new_image));
    if (!frame.mask.empty()) WriteMaskOf(frame.camera, path(frame.mask), path(frame.new_mask));
  });
  return io::TaskResults(tasks.size());
}

constexpr const char* kUndistortWork = "undistort";

std::string Tell(const std::vector<FrameFiles>& frames) {
  io::Packer told;
  told.Add(frames.size());
  for (const FrameFiles& f : frames)
    told.Add(f.camera).Add(f.image).Add(f.new_image).Add(f.mask).Add(f.new_mask);
  return told.Take();
}

std::vector<FrameFiles> ToldFrames(const std::string& bytes) {
  io::Unpacker told(bytes);
  std::vector<FrameFiles> frames(told.Take<std::size_t>());
  for (FrameFiles& frame : frames) {
    told.Take(&frame.camera);
    for (std::string* name : {&frame.image, &frame.new_image, &frame.mask, &frame.new_mask}) told.Take(name);
  }
  return frames;
}

}  // namespace

bool HasRaysAtBorder(const io::Camera& camera) {
  for (int i = 0; i <= kBorderSamples; ++i) {
    const double x = camera.width * static_cast<double>(i) / kBorderSamples;
    const double y = camera.height * static_cast<double>(i) / kBorderSamples;
    for (const Eigen::Vector2d& xy : {Eigen::Vector2d(0, y),
                                      {static_cast<double>(camera.width), y},
                                      {x, 0},
                                      {x, static_cast<double>(camera.height)}}) {
      if (!io::RayFromImg(camera, xy)) return false;
    }
  }
  return true;
}

io::Camera PinholeCamera(const io::Camera& camera) {
  if (!camera.HasDistortion()) return camera;
  // Half extents, as tangents, of the largest centred rectangle inside the undistorted border.
  double left = HUGE_VAL, right = HUGE_VAL, top = HUGE_VAL, bottom = HUGE_VAL;
  const auto tangents = [&](double x, double y) {
    const auto ray = io::RayFromImg(camera, {x, y});
    if (!ray) {
      throw io::Error(
          io::ExitCode::kBadInput,
          fmt::format(
              "the lens distortion (k1 {:f}, k2 {:f}) folds back inside the picture", camera.k1, camera.k2),
          "The camera parameters are wrong; reconstruct the poses again");
    }
    return Eigen::Vector2d(ray->x() / -ray->z(), ray->y() / ray->z());  // y down
  };
  for (int i = 0; i <= kBorderSamples; ++i) {
    const double x = camera.width * static_cast<double>(i) / kBorderSamples;
    const double y = camera.height * static_cast<double>(i) / kBorderSamples;
    left = std::min(left, -tangents(0, y).x());
    right = std::min(right, tangents(camera.width, y).x());
    top = std::min(top, -tangents(x, 0).y());
    bottom = std::min(bottom, tangents(x, camera.height).y());
  }
  const double half_width = std::min(left, right) * camera.fl_x,
               half_height = std::min(top, bottom) * camera.fl_y;
  if (!(half_width > 0) || !(half_height > 0)) {
    throw io::Error(io::ExitCode::kBadInput, "a camera's principal point lies outside its picture");
  }
  const double zoom = std::max(camera.width / (2 * half_width), camera.height / (2 * half_height));
  return {.width = camera.width,
          .height = camera.height,
          .fl_x = camera.fl_x * zoom,
          .fl_y = camera.fl_y * zoom,
          .cx = camera.width / 2.0,
          .cy = camera.height / 2.0};
}

io::Scene UndistortScene(const io::Scene& scene, const fs::path& target, int threads) {
  const fs::path folder = fs::absolute(target).lexically_normal();
  io::Scene result = scene;
  std::transform(scene.cameras.begin(), scene.cameras.end(), result.cameras.begin(), PinholeCamera);
  fs::create_directories(folder / "images");
  const std::vector<std::string> names = TargetNames(scene);
  std::vector<FrameFiles> frames;
  for (std::size_t i = 0; i < scene.frames.size(); ++i) {
    const io::Frame& frame = scene.frames[i];
    const auto relative = [&](const fs::path& path) {
      return path.empty() ? std::string() : fs::absolute(path).lexically_relative(folder).string();
    };
    frames.push_back({.camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)],
                      .image = relative(frame.image_path),
                      .new_image = "images/" + names[i],
                      .mask = relative(frame.mask_path)});
    if (!frame.mask_path.empty())
      frames[i].new_mask = "masks/" + fs::path(names[i]).replace_extension(".png").string();
    result.frames[i].image_path = folder / frames[i].new_image;
    result.frames[i].mask_path = frames[i].new_mask.empty() ? "" : folder / frames[i].new_mask;
  }
  io::ShareOut(
      kUndistortWork,
      frames.size(),
      [&] { return Tell(frames); },
      [&](const std::vector<std::size_t>& tasks) { return WriteSome(frames, folder, threads, tasks); });
  return result;
}

void AddUndistortionWork(const fs::path& folder, int threads, io::ToldWorks* works) {
  (*works)[kUndistortWork] = [=](const std::string& told, const std::vector<std::size_t>& tasks) {
    return WriteSome(ToldFrames(told), fs::absolute(folder), threads, tasks);
  };
}

}  // namespace sfm
