// `pipeline normalize`: posed pictures in, the training scene out (pictures at training size, poses in scene
// units, the split, near, far, aabb).
#include "sfm/scene/normalize.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <set>

#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/base/median.h"
#include "io/base/natural_order.h"
#include "io/image/image.h"
#include "io/image/mask.h"
#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "pipeline/evaluation/heldout_split.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_run.h"
#include "pipeline/stages/pose_source.h"
#include "pipeline/stages/scene_record.h"
#include "pipeline/stages/stage_options.h"
#include "pipeline/stages/stages.h"
#include "sfm/scene/undistort.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

// All NeRF-synthetic objects lie within 1.5 of the origin, on all three axes.
constexpr double kBlenderHalfSide = 1.5;
// Of a picture while it is undistorted: read, premultiplied in float, resampled, with the map of its pixels.
constexpr std::size_t kBytesPerPixel = 48;
constexpr std::size_t kMaxNamed = 5;  // missing pictures named on the terminal; scene.json lists them all

// Frames in natural order of their names, with a split each.
void SplitFrames(const NormalizeFlags& options, PoseSource* source, StageRun* stage) {
  const std::vector<io::Frame> frames = source->scene.frames;
  const std::vector<std::string> given = source->splits;
  std::vector<std::size_t> order(frames.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return io::NaturalLess(frames[a].image_path.string(), frames[b].image_path.string());
  });
  source->splits.resize(frames.size());
  std::vector<int> new_index(frames.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    new_index[order[i]] = static_cast<int>(i);
    source->scene.frames[i] = frames[order[i]];
    if (!given.empty()) source->splits[i] = given[order[i]];
  }
  io::RenumberObservers(new_index, &source->scene.points);
  if (!given.empty()) {
    stage->Decide("split: kept as given");
    return;
  }
  const std::vector<bool> is_held_out =
      HeldOutFrames(source->scene.frames, options.holdout, options.holdout_every);
  for (std::size_t i = 0; i < frames.size(); ++i) source->splits[i] = is_held_out[i] ? "test" : "train";
  stage->Decide(options.holdout == "sector"
                    ? fmt::format("split: one side of the capture, {} pictures, is held out for testing",
                                  std::count(is_held_out.begin(), is_held_out.end(), true))
                    : fmt::format("split: every {}th picture in natural order is held out for testing",
                                  options.holdout_every));
}

// Equal pictures in train and test make every score worthless.
void WarnOfLeakage(const PoseSource& source, StageRun* stage) {
  std::set<std::string> trained;
  for (const bool is_train : {true, false}) {
    std::size_t shared = 0;
    for (std::size_t i = 0; i < source.splits.size(); ++i) {
      if ((source.splits[i] == "train") != is_train) continue;
      const std::string hash = io::HashFile(source.scene.frames[i].image_path);
      if (is_train)
        trained.insert(hash);
      else
        shared += source.splits[i] == "test" && trained.contains(hash);
    }
    if (shared > 0) stage->Decide(fmt::format("warning: {} test pictures are training pictures too", shared));
  }
}

// Where each frame's picture goes, relative to the stage's folder: <split>/<stem>.png for a given split,
// otherwise images/<stem>.png. Equal names, which come from different folders, get their number in front.
std::vector<fs::path> PictureNames(const PoseSource& source, bool is_split_given) {
  std::vector<fs::path> names;
  std::set<fs::path> seen;
  bool is_unique = true;
  for (std::size_t i = 0; i < source.scene.frames.size(); ++i) {
    const fs::path folder = is_split_given ? source.splits[i] : "images";
    names.push_back(folder / (source.scene.frames[i].image_path.stem().string() + ".png"));
    is_unique = seen.insert(names.back()).second && is_unique;
  }
  for (std::size_t i = 0; !is_unique && i < names.size(); ++i) {
    names[i].replace_filename(fmt::format("{:05}_{}", i + 1, names[i].filename().string()));
  }
  return names;
}

// The camera for pictures whose longest side is at most `limit` (0: any).
io::Camera LimitedCamera(const io::Camera& camera, int limit) {
  const int longest = std::max(camera.width, camera.height);
  if (limit == 0 || longest <= limit) return camera;
  const auto scaled = [&](int side) {
    return std::max(1, static_cast<int>(std::lround(static_cast<double>(side) * limit / longest)));
  };
  return io::ResizedCamera(camera, scaled(camera.width), scaled(camera.height));
}

// A whole PNG that needs no resizing becomes a hard link to the same file, or a copy where the file system
// has no hard links.
void PlacePicture(const fs::path& from, const fs::path& to, int width, int height, const io::Camera& camera) {
  fs::create_directories(to.parent_path());
  const io::Image image = io::ReadImage(from);
  if (width == camera.width && height == camera.height && from.extension() == ".png") {
    std::error_code error;
    fs::create_hard_link(fs::canonical(from), to, error);
    if (error) fs::copy_file(from, to);
    return;
  }
  io::WriteImage(to, io::ResizeArea(image, width, height));
}

// Writes the pictures at training size, and their masks at the same below masks/; the scene then has the
// cameras and absolute paths of these. Returns the share of all pixels that are used.
double WritePictures(
    const std::vector<fs::path>& names, int limit, int threads, const fs::path& folder, io::Scene* scene) {
  std::vector<io::Camera> cameras = scene->cameras;
  std::atomic<std::size_t> n_pixels = 0, n_used = 0;
  for (io::Camera& camera : cameras) camera = LimitedCamera(camera, limit);
  io::Workers(threads).Run(static_cast<int>(names.size()), [&](int task, int) {
    io::ThrowIfInterrupted();
    const auto i = static_cast<std::size_t>(task);
    io::Frame& frame = scene->frames[i];
    const io::Camera& full = scene->cameras[static_cast<std::size_t>(frame.camera_index)];
    const io::Camera& camera = cameras[static_cast<std::size_t>(frame.camera_index)];
    const fs::path target = folder / names[i];
    PlacePicture(frame.image_path, target, camera.width, camera.height, full);
    frame.image_path = target;
    const std::size_t size = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
    n_pixels += size;
    if (frame.mask_path.empty()) {
      n_used += size;
      return;
    }
    const io::Mask mask =
        io::ShrinkMask(io::ReadMask(frame.mask_path, full.width, full.height), camera.width, camera.height);
    frame.mask_path = folder / "masks" / names[i];
    io::WriteMask(frame.mask_path, mask);
    n_used += mask.UsedCount();
  });
  scene->cameras = std::move(cameras);
  return static_cast<double>(n_used) / static_cast<double>(n_pixels);
}

int CountMasks(const io::Scene& scene) {
  return static_cast<int>(std::count_if(scene.frames.begin(), scene.frames.end(), [](const io::Frame& frame) {
    return !frame.mask_path.empty();
  }));
}

// The frames of a split. Only those of training keep the points, as far as they observe them: what held-out
// pictures saw must not help.
io::Scene ScenePart(const PoseSource& source, const std::string& split) {
  io::Scene part = source.scene;
  part.frames.clear();
  std::vector<int> new_index(source.splits.size(), -1);
  for (std::size_t i = 0; i < source.splits.size(); ++i) {
    if (source.splits[i] != split) continue;
    new_index[i] = static_cast<int>(part.frames.size());
    part.frames.push_back(source.scene.frames[i]);
  }
  if (split == "train") {
    io::RenumberObservers(new_index, &part.points);
  } else {
    part.points.clear();
  }
  return part;
}

// transforms_<split>.json of every split that has frames, read back as the next stages will read it.
void WriteSplits(const PoseSource& source, const fs::path& folder) {
  for (const std::string split : {"train", "val", "test"}) {
    const io::Scene part = ScenePart(source, split);
    if (part.frames.empty()) continue;
    const bool has_points = !part.points.empty();
    if (has_points) io::WritePly(folder / "points.ply", part.points);
    const fs::path json_path = folder / ("transforms_" + split + ".json");
    io::WriteTransforms(json_path, part, has_points ? "points.ply" : "");
    const io::TransformsFile file = io::ReadTransforms(json_path);
    if (file.scene.frames.size() != part.frames.size() || !file.missing_images.empty())
      throw io::Error(io::ExitCode::kInternal, json_path.string() + ": does not read back as written");
  }
}

// "nerf-400-white" and "nerf-800-white" are the protocols of published numbers; other sizes are named alike.
std::string ProtocolName(const PoseSource& source, bool is_sector) {
  const io::Camera& camera = source.scene.cameras[0];
  const int longest = std::max(camera.width, camera.height);
  return source.is_blender ? fmt::format("nerf-{}-white", longest)
         : is_sector       ? "capture, sector"
                           : "capture";
}

// Moves the scene; keeps it, and reports nothing, when it already lies as it should.
std::optional<sfm::NormalizeReport> PlaceScene(PoseSource* source, StageRun* stage) {
  io::Scene& scene = source->scene;
  if (source->is_blender) {
    scene.near = 2;
    scene.far = 6;
    scene.aabb = {Eigen::Vector3d::Constant(-kBlenderHalfSide), Eigen::Vector3d::Constant(kBlenderHalfSide)};
    stage->Decide("scale: NeRF-synthetic files have near 2, far 6 and pass through unchanged");
  } else if (source->is_normalised) {
    stage->Decide("scale: the file states near, far and aabb and passes through unchanged");
  } else {
    sfm::NormalizeReport report = sfm::NormalizeScene(scene);
    for (const std::string& line : report.decisions) stage->Decide(line);
    scene = std::move(report.scene);
    return report;
  }
  return std::nullopt;
}

// Points that all lie in one place, but for a few strays, say nothing about depth: they are placeholders.
void DropPlaceholders(io::Scene* scene, StageRun* stage) {
  // Of the distance from the median camera: what is measured in a picture has errors a thousand times as
  // large.
  constexpr double kOnePlace = 1e-6, kLowest = 0.05, kHighest = 0.95;
  if (scene->points.size() < 2 || scene->frames.empty()) return;
  Eigen::Vector3d size, middle, centre;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> points, cameras;
    for (const io::Point3D& point : scene->points) points.push_back(point.xyz[c]);
    for (const io::Frame& frame : scene->frames) cameras.push_back(frame.world_from_cam.translation[c]);
    size[c] = io::Quantile(points, kHighest) - io::Quantile(points, kLowest);
    middle[c] = io::Median(std::move(points));
    centre[c] = io::Median(std::move(cameras));
  }
  if (size.norm() > kOnePlace * (middle - centre).norm()) return;
  stage->Decide(
      fmt::format("input: the {} sparse points lie in one place and are left out", scene->points.size()));
  scene->points.clear();
}

void DecideAboutInput(const PoseSource& source, StageRun* stage) {
  for (const std::string& note : source.notes) stage->Decide("input: " + note);
  if (source.missing_images.empty()) return;
  std::string line =
      fmt::format("{} posed pictures do not exist and are left out:", source.missing_images.size());
  for (std::size_t i = 0; i < std::min(kMaxNamed, source.missing_images.size()); ++i)
    line += " " + source.missing_images[i];
  stage->Decide(line + (source.missing_images.size() > kMaxNamed ? " ..." : ""));
}

void Normalize(const CommonOptions& common, const NormalizeFlags& options, const Options& flags) {
  PoseSource source = options.poses.empty() ? ReadSfmPoses(fs::absolute(common.out) / "sfm")
                                            : ReadPoses(options.poses, options.images);
  StageRun stage("normalize", common, flags, source.files);
  if (stage.IsUpToDate()) return;
  std::size_t largest = 0;
  for (const io::Camera& camera : source.scene.cameras)
    largest = std::max(
        largest,
        kBytesPerPixel * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  const int threads =
      ResolvedMemory(common).AtOnce(ResolvedThreads(common), largest, 0, "normalize: resizing a picture");
  DecideAboutInput(source, &stage);
  DropPlaceholders(&source.scene, &stage);
  const std::optional<sfm::NormalizeReport> report = PlaceScene(&source, &stage);

  const fs::path undistorted = stage.folder() / "undistorted";
  const bool is_distorted = std::any_of(source.scene.cameras.begin(),
                                        source.scene.cameras.end(),
                                        [](const io::Camera& camera) { return camera.HasDistortion(); });
  const bool is_split_given = !source.splits.empty();
  SplitFrames(options, &source, &stage);
  WarnOfLeakage(source, &stage);
  const std::vector<fs::path> names = PictureNames(source, is_split_given);
  if (is_distorted) {
    stage.Decide("pictures: the lens distortion is removed");
    source.scene = sfm::UndistortScene(source.scene, undistorted, threads);
  }
  // NeRF-synthetic pictures have the size of their protocol; another size must be asked for.
  const bool keep_size = source.is_blender && !flags.IsSetByUser("image-size");
  const int size_limit = keep_size ? 0 : options.image_size;
  SceneRecord record;
  record.used_share = WritePictures(names, size_limit, threads, stage.folder(), &source.scene);
  fs::remove_all(undistorted);
  const io::Camera& camera = source.scene.cameras[0];
  stage.Decide(fmt::format("pictures: {} x {} for training", camera.width, camera.height));
  // Names the size of the written pictures.
  record.protocol = ProtocolName(source, !is_split_given && options.holdout == "sector");
  record.masks = CountMasks(source.scene);
  if (record.masks > 0) {
    stage.Decide(fmt::format("masks: for {} of {} pictures; training and scores use {} % of all pixels",
                             record.masks,
                             source.scene.frames.size(),
                             std::lround(100 * record.used_share)));
  }
  WriteSplits(source, stage.folder());
  WriteSceneRecord(record, source, report, &stage);
  stage.Finish();
}

}  // namespace

int RunNormalize(int argc, const char* const* argv) {
  return GuardedMain("pipeline normalize", [&] {
    CommonOptions common;
    NormalizeFlags options;
    Options flags(
        "pipeline normalize",
        "Moves and scales the posed pictures to near 2, far 6, and splits them into train and test.");
    AddCommonOptions(&flags, &common);
    AddNormalizeOptions(&flags, &options);
    if (!flags.Parse(argc, argv)) return;
    Normalize(common, options, flags);
  });
}

}  // namespace pipeline
