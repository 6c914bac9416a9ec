#include "pipeline/stages/pose_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "io/base/error.h"
#include "io/image/image_size.h"
#include "io/scene/colmap_model.h"
#include "io/scene/transforms.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Error;
using io::ExitCode;

const char* const kSplits[] = {"train", "val", "test"};

fs::path SplitFile(const fs::path& folder, const std::string& split) {
  return folder / ("transforms_" + split + ".json");
}

// Adds the frames of one more file; cameras that are alike stay one.
void Append(const io::TransformsFile& file, const std::string& split, PoseSource* source) {
  io::Scene& scene = source->scene;
  for (io::Frame frame : file.scene.frames) {
    const io::Camera& camera = file.scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const auto found = std::find(scene.cameras.begin(), scene.cameras.end(), camera);
    frame.camera_index = static_cast<int>(found - scene.cameras.begin());
    if (found == scene.cameras.end()) scene.cameras.push_back(camera);
    source->files.push_back(frame.image_path);
    if (!frame.mask_path.empty()) source->files.push_back(frame.mask_path);
    scene.frames.push_back(std::move(frame));
    if (!split.empty()) source->splits.push_back(split);
  }
  if (scene.points.empty()) scene.points = file.scene.points;
  const auto add_all = [](const std::vector<std::string>& from, std::vector<std::string>* to) {
    to->insert(to->end(), from.begin(), from.end());
  };
  add_all(file.missing_images, &source->missing_images);
  add_all(file.notes, &source->notes);
}

PoseSource ReadTransformsFile(const fs::path& json_path) {
  const io::TransformsFile file = io::ReadTransforms(json_path);
  PoseSource source;
  source.scene = file.scene;
  source.scene.frames.clear();
  Append(file, "", &source);
  source.is_normalised = file.has_near_far;
  source.files.push_back(json_path);
  return source;
}

PoseSource ReadTransformsSplits(const fs::path& folder) {
  PoseSource source;
  bool is_first = true, has_test = false;
  for (const std::string split : kSplits) {
    const fs::path json_path = SplitFile(folder, split);
    if (!fs::exists(json_path)) continue;
    const io::TransformsFile file = io::ReadTransforms(json_path);
    const bool is_blender = file.dialect == io::TransformsDialect::kBlender;
    if (is_first) {
      source.is_blender = is_blender;
      source.is_normalised = file.has_near_far;
      source.scene = file.scene;
      source.scene.cameras.clear();
      source.scene.frames.clear();
    } else if (is_blender != source.is_blender || file.has_near_far != source.is_normalised) {
      throw Error(ExitCode::kBadInput,
                  json_path.string() + ": is of another dialect than transforms_train.json",
                  "Keep files of one origin together");
    }
    is_first = false;
    has_test |= split == "test";
    Append(file, split, &source);
    source.files.push_back(json_path);
  }
  // Without test views the split says nothing about what to hold out.
  if (!has_test) source.splits.clear();
  return source;
}

// Drops the frames whose picture does not exist, and their observations.
void KeepExistingPictures(const fs::path& images, PoseSource* source) {
  io::Scene& scene = source->scene;
  std::vector<int> new_index(scene.frames.size(), -1);
  std::vector<io::Frame> kept;
  for (std::size_t i = 0; i < scene.frames.size(); ++i) {
    io::Frame frame = scene.frames[i];
    const std::string name = frame.image_path.string();
    frame.image_path = images / name;
    if (!fs::is_regular_file(frame.image_path)) {
      source->missing_images.push_back(name);
      continue;
    }
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const io::ImageSize size = io::ReadImageSize(frame.image_path);
    if (size.width != camera.width || size.height != camera.height) {
      throw Error(ExitCode::kBadInput,
                  fmt::format("{}: is {} x {}, but its camera {} x {}",
                              frame.image_path.string(),
                              size.width,
                              size.height,
                              camera.width,
                              camera.height),
                  "Give the pictures that COLMAP was given");
    }
    source->files.push_back(frame.image_path);
    new_index[i] = static_cast<int>(kept.size());
    kept.push_back(std::move(frame));
  }
  scene.frames = std::move(kept);
  io::RenumberObservers(new_index, &scene.points);
}

PoseSource ReadColmapPoses(const fs::path& model_folder, fs::path images) {
  PoseSource source;
  source.scene = io::ReadColmapModel(model_folder).scene;
  if (source.scene.frames.empty()) {
    throw Error(ExitCode::kBadInput, model_folder.string() + ": poses no picture", "Give another sub-model");
  }
  if (images.empty()) {
    for (const char* place : {"images", "../images", "../../images"}) {
      const fs::path candidate = (model_folder / place).lexically_normal();
      if (images.empty() && fs::is_directory(candidate)) images = candidate;
    }
  }
  if (!fs::is_directory(images)) {
    throw Error(
        ExitCode::kBadInput, model_folder.string() + ": its pictures were not found", "Give --images DIR");
  }
  for (const auto& entry : fs::directory_iterator(model_folder)) {
    if (entry.is_regular_file()) source.files.push_back(entry.path());
  }
  KeepExistingPictures(images, &source);
  if (source.scene.frames.empty()) {
    throw Error(ExitCode::kBadInput,
                images.string() + ": holds none of the model's pictures, first " + source.missing_images[0],
                "Give the folder that COLMAP was given with --images DIR");
  }
  return source;
}

// The sub-model with most pictures: COLMAP numbers them in the order of creation, not of size.
fs::path LargestModel(const fs::path& sparse_folder) {
  if (io::IsColmapModel(sparse_folder)) return sparse_folder;
  std::vector<fs::path> models;
  for (const auto& entry : fs::directory_iterator(sparse_folder)) {
    if (entry.is_directory() && io::IsColmapModel(entry.path())) models.push_back(entry.path());
  }
  std::sort(models.begin(), models.end());
  fs::path largest;
  std::size_t most = 0;
  for (const fs::path& model : models) {
    const std::size_t count = io::ReadColmapModel(model).scene.frames.size();
    if (count > most) most = count, largest = model;
  }
  return largest;
}

}  // namespace

PoseSource ReadPoses(const fs::path& given, const fs::path& given_images) {
  const fs::path poses = fs::absolute(given).lexically_normal();
  const fs::path images = given_images.empty() ? fs::path() : fs::absolute(given_images).lexically_normal();
  if (fs::is_regular_file(poses)) {
    const bool is_one_split = std::any_of(std::begin(kSplits), std::end(kSplits), [&](const char* split) {
      return poses == SplitFile(poses.parent_path(), split);
    });
    const bool has_train = fs::exists(SplitFile(poses.parent_path(), "train"));
    return is_one_split && has_train ? ReadTransformsSplits(poses.parent_path()) : ReadTransformsFile(poses);
  }
  if (fs::is_regular_file(poses / "transforms.json")) return ReadTransformsFile(poses / "transforms.json");
  if (fs::is_regular_file(SplitFile(poses, "train"))) return ReadTransformsSplits(poses);
  if (io::IsColmapModel(poses)) return ReadColmapPoses(poses, images);
  if (fs::is_directory(poses / "sparse")) {
    const fs::path model = LargestModel(poses / "sparse");
    if (!model.empty()) return ReadColmapPoses(model, images);
  }
  throw Error(ExitCode::kBadInput,
              given.string() + ": holds no poses",
              "Give a transforms.json, a folder with one, or a COLMAP model folder");
}

PoseSource ReadSfmPoses(const fs::path& sfm_folder) {
  const fs::path json_path = sfm_folder / "transforms.json";
  if (!fs::exists(json_path)) {
    throw Error(ExitCode::kBadInput,
                json_path.string() + ": no such file",
                "Run `pipeline sfm` first, or give --poses PATH");
  }
  PoseSource source = ReadTransformsFile(json_path);
  const fs::path sparse = sfm_folder / "sparse";
  const fs::path model_folder = fs::is_directory(sparse) ? LargestModel(sparse) : fs::path();
  if (model_folder.empty()) return source;  // its points are those of points.ply, without tracks
  // The pictures were undistorted, and may have changed their extension.
  std::map<std::string, int> index_of_stem;
  for (std::size_t i = 0; i < source.scene.frames.size(); ++i)
    index_of_stem[source.scene.frames[i].image_path.stem().string()] = static_cast<int>(i);
  const io::Scene model = io::ReadColmapModel(model_folder).scene;
  source.scene.points.clear();
  for (io::Point3D point : model.points) {
    std::vector<int> observers;
    for (int i : point.frame_indices) {
      const auto found =
          index_of_stem.find(model.frames[static_cast<std::size_t>(i)].image_path.stem().string());
      if (found != index_of_stem.end()) observers.push_back(found->second);
    }
    point.frame_indices = std::move(observers);
    if (!point.frame_indices.empty()) source.scene.points.push_back(std::move(point));
  }
  if (source.scene.points.empty() && !model.points.empty()) {
    throw Error(ExitCode::kBadState,
                model_folder.string() + ": observes none of the pictures of " + json_path.string(),
                "Run `pipeline sfm --force`");
  }
  for (const auto& entry : fs::directory_iterator(model_folder)) {
    if (entry.is_regular_file()) source.files.push_back(entry.path());
  }
  return source;
}

}  // namespace pipeline
