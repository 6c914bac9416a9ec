// Takes the photographs, films, and writes down the truth.
#include "samples/capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "io/scene/transforms.h"
#include "io/video/video_writer.h"
#include "samples/noise.h"
#include "samples/photo_file.h"
#include "samples/photograph.h"
#include "samples/trajectory.h"

namespace samples {
namespace {

namespace fs = std::filesystem;
using io::Error;
using io::ExitCode;

constexpr int kReferenceWidth = 960;  // at this width a texel of paint is about a pixel
constexpr int kFramesPerKnock = 3, kBlurPoses = 16;
constexpr double kSecondsPerPhoto = 3, kBaseExposure_s = 1.0 / 80;
constexpr int kDepthEvery = 10;

void CheckOptions(const CaptureOptions& options) {
  if (options.out.empty()) throw Error(ExitCode::kUsage, "--out is missing", "Name the folder to write");
  if (options.width < 64 || options.width > 8192 || options.width % 8 != 0) {
    throw Error(ExitCode::kUsage,
                fmt::format("--width {}: no width to film with", options.width),
                "Choose a multiple of 8 from 64 to 8192");
  }
  if (options.photos < 1 || options.photos > 9999) {
    throw Error(ExitCode::kUsage, fmt::format("--photos {}", options.photos), "Choose 1 to 9999");
  }
  if (options.threads < 1) throw Error(ExitCode::kUsage, "--threads must be at least 1");
  if (fs::exists(options.out) && !(fs::is_directory(options.out) && fs::is_empty(options.out))) {
    throw Error(ExitCode::kUsage, options.out.string() + ": exists", "Choose another folder or remove it");
  }
}

std::vector<io::Rigid3d> PosesOf(const CaptureOptions& options) {
  switch (options.kind) {
    case CaptureKind::kRotation:
      return RotationPoses(options.photos, options.seed);
    case CaptureKind::kForward:
      return ForwardPoses(options.photos, options.seed);
    case CaptureKind::kPhotos:
    case CaptureKind::kBlank:
    case CaptureKind::kVideo:
      break;
  }
  return OrbitPoses(options.photos, options.seed);
}

void WriteDepth(const fs::path& path, const io::Camera& camera, const std::vector<float>& depth) {
  // PFM: little-endian floats (scale -1), rows from bottom to top.
  static_assert(std::endian::native == std::endian::little);
  const std::size_t row_bytes = static_cast<std::size_t>(camera.width) * sizeof(float);
  std::string bytes = fmt::format("Pf\n{} {}\n-1.0\n", camera.width, camera.height);
  for (int y = camera.height - 1; y >= 0; --y) {
    bytes.append(
        reinterpret_cast<const char*>(&depth[static_cast<std::size_t>(std::ptrdiff_t{y} * camera.width)]),
        row_bytes);
  }
  io::WriteFileAtomically(path, bytes);
}

void TakePhotos(const CaptureOptions& options, const StillLife& still_life, const fs::path& folder) {
  const io::Camera camera = CaptureCamera(options);
  const Photographer photographer(camera, options.photo_samples, options.threads);
  const std::vector<io::Rigid3d> poses = PosesOf(options);
  const double focal_35mm = camera.fl_x * std::hypot(36, 24) / std::hypot(camera.width, camera.height);
  io::Scene truth;
  truth.cameras = {camera};
  fs::create_directories(folder / "truth/photos");
  io::Progress progress("photographs");
  for (int i = 0; i < options.photos; ++i) {
    io::ThrowIfInterrupted();
    const double ev = options.exposure_ev * (2 * UnitHash(i, 7, options.seed) - 1);
    const Exposure exposure{ev, options.noise_sigma, Hash(i, 8, options.seed)};
    const io::Rigid3d& pose = poses[static_cast<std::size_t>(i)];
    const std::string stem = fmt::format("IMG_{:04}", i + 1);
    WritePhoto(folder / "photos" / (stem + ".jpg"),
               photographer.Take(still_life, {pose}, exposure),
               options.jpeg_quality,
               {focal_35mm, kBaseExposure_s * std::exp2(ev), static_cast<int>(kSecondsPerPhoto * i)});
    if (options.depth && i % kDepthEvery == 0) {
      WriteDepth(folder / "truth/depth" / (stem + ".pfm"), camera, photographer.TakeDepth(still_life, pose));
    }
    // The reader of transforms.json takes only pictures below the file: the same photograph under a second
    // name.
    fs::create_hard_link(folder / "photos" / (stem + ".jpg"), folder / "truth/photos" / (stem + ".jpg"));
    truth.frames.push_back({fs::path("photos") / (stem + ".jpg"), 0, pose});
    progress.Update((i + 1.0) / options.photos);
  }
  io::WriteTransforms(folder / "truth/transforms.json", truth, "");
}

// First frames of the knocks: one in each equal part of the film, never at its very beginning.
std::vector<int> KnockStarts(const CaptureOptions& options, int frames) {
  std::vector<int> starts;
  for (int k = 0; k < options.video_blurs; ++k) {
    const double part = (k + 0.2 + 0.6 * UnitHash(k, 9, options.seed)) / options.video_blurs;
    starts.push_back(static_cast<int>(part * (frames - kFramesPerKnock)));
  }
  return starts;
}

int Film(const CaptureOptions& options, const StillLife& still_life, const fs::path& folder) {
  const io::Camera camera = CaptureCamera(options);
  const fs::path frame_folder = folder / "frames";
  fs::create_directories(frame_folder);
  const io::VideoEncoder encoder = io::ProbeVideoEncoder(camera.width, camera.height, frame_folder);
  const Photographer sharp(camera, options.video_samples, options.threads),
      blurred(camera, 1, options.threads);
  const int frames = static_cast<int>(std::lround(options.video_s * options.video_fps));
  const std::vector<int> knocks = KnockStarts(options, frames);
  io::Scene truth;
  truth.cameras = {camera};
  std::string blurred_names;
  io::Progress progress("film");
  for (int i = 0; i < frames; ++i) {
    io::ThrowIfInterrupted();
    const std::string name = fmt::format("frame_{:06}.png", i);  // as `pipeline ingest` will call it
    const io::Rigid3d pose = WalkPose(i / options.video_fps, options.video_s, options.seed);
    const double ev = options.exposure_ev * std::sin(8.0 * i / frames);  // the camera adjusts itself slowly
    const Exposure exposure{ev, options.noise_sigma, Hash(i, 8, options.seed)};
    const bool knocked = std::any_of(
        knocks.begin(), knocks.end(), [&](int start) { return i >= start && i < start + kFramesPerKnock; });
    std::vector<io::Rigid3d> poses = {pose};
    if (knocked) {
      poses.clear();  // symmetric around the pose that is written down
      for (int b = 0; b < kBlurPoses; ++b) {
        poses.push_back(KnockedPose(pose, options.blur_angle * ((b + 0.5) / kBlurPoses - 0.5)));
      }
      blurred_names += name + "\n";
    }
    io::WriteImage(frame_folder / io::VideoFrameName(i),
                   (knocked ? blurred : sharp).Take(still_life, poses, exposure));
    truth.frames.push_back({name, 0, pose});
    progress.Update((i + 1.0) / frames);
  }
  io::EncodeVideo(encoder, frame_folder, frames, options.video_fps, folder / "walkaround.mp4");
  fs::remove_all(frame_folder);
  io::WriteTransforms(folder / "truth/transforms.json", truth, "");
  io::WriteFileAtomically(folder / "truth/blurred_frames.txt", blurred_names);
  return frames;
}

void TakeTestViews(const CaptureOptions& options, const StillLife& still_life, const fs::path& folder) {
  io::Camera pinhole = CaptureCamera(options);
  pinhole.k1 = 0;
  const Photographer photographer(pinhole, options.photo_samples, options.threads);
  io::Scene truth;
  truth.cameras = {pinhole};
  for (const io::Rigid3d& pose : TestPoses(options.test_views)) {
    const fs::path name = fs::path("test") / fmt::format("{:03}.png", truth.frames.size() + 1);
    io::WriteImage(folder / "truth" / name, photographer.Take(still_life, {pose}, {}));
    truth.frames.push_back({name, 0, pose});
  }
  io::WriteTransforms(folder / "truth/transforms_test.json", truth, "");
}

}  // namespace

CaptureKind ParseCaptureKind(const std::string& name) {
  if (name == "photos") return CaptureKind::kPhotos;
  if (name == "video") return CaptureKind::kVideo;
  if (name == "rotation") return CaptureKind::kRotation;
  if (name == "blank") return CaptureKind::kBlank;
  if (name == "forward") return CaptureKind::kForward;
  throw Error(
      ExitCode::kUsage, "--kind " + name + ": unknown", "Choose photos, video, rotation, blank or forward");
}

io::Camera CaptureCamera(const CaptureOptions& options) {
  const int height = options.width * 3 / 4;
  const double focal = options.focal_per_width * options.width;
  return {.width = options.width,
          .height = height,
          .fl_x = focal,
          .fl_y = focal,
          .cx = 0.5 * options.width,
          .cy = 0.5 * height,
          .k1 = options.k1};
}

CaptureReport WriteCapture(const CaptureOptions& options) {
  CheckOptions(options);
  const auto start = std::chrono::steady_clock::now();
  const fs::path target = fs::absolute(options.out).lexically_normal();
  const fs::path folder = target.string() + ".partial";
  io::RequireOwnedFolder(target);
  io::RecreateOwnedFolder(folder);
  fs::create_directories(folder / "truth");
  const StillLife still_life({.seed = options.seed,
                              .blank = options.kind == CaptureKind::kBlank,
                              .detail = static_cast<double>(options.width) / kReferenceWidth,
                              .threads = options.threads});
  CaptureReport report;
  if (options.kind == CaptureKind::kVideo) {
    report.pictures = Film(options, still_life, folder);
  } else {
    TakePhotos(options, still_life, folder);
    report.pictures = options.photos;
  }
  if (options.test_views > 0) TakeTestViews(options, still_life, folder);
  io::ReplaceFolder(folder, target);
  report.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace samples
