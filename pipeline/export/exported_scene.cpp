#include "pipeline/export/exported_scene.h"

#include <algorithm>
#include <map>
#include <set>

#include "io/base/error.h"
#include "io/scene/transforms.h"
#include "pipeline/export/export_place.h"
#include "pipeline/stage/hash_tree.h"
#include "pipeline/stages/trained_scene.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

void RequireFile(const fs::path& path, const std::string& command) {
  if (!fs::is_regular_file(path))
    throw io::Error(io::ExitCode::kBadInput, path.string() + ": no such file", "Run " + command + " first");
}

// `normalize` puts pictures into images/, or train/ and test/ where the split was given.
std::string NameOf(const fs::path& scene_folder, const fs::path& picture) {
  const fs::path relative = picture.lexically_normal().lexically_relative(scene_folder);
  const fs::path path = *relative.begin() == "images" ? relative.lexically_relative("images") : relative;
  std::string name = path.generic_string();
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c >= 0 && c <= ' '; }, '_');
  return name;
}

}  // namespace

fs::path RequireTrainedField(const fs::path& run_folder) {
  const fs::path run = AbsolutePath(run_folder), checkpoint = run / "train/checkpoint.bin";
  RequireFile(checkpoint, "pipeline train");
  std::map<std::string, std::string> hashes;
  for (const fs::path& input : {run / "scene", checkpoint}) HashTree(input, {}, &hashes);
  RequireTrainedOnThisScene(run, hashes, checkpoint);
  return checkpoint;
}

ExportedScene LoadExportedScene(const fs::path& run_folder,
                                const FrameOptions& frame,
                                bool with_field,
                                int threads) {
  const fs::path run = AbsolutePath(run_folder);
  const fs::path train = run / "scene/transforms_train.json", test = run / "scene/transforms_test.json";
  RequireFile(train, "pipeline normalize, or pipeline run,");
  ExportedScene scene;
  scene.name = run.filename().string();
  scene.folder = run / "scene";
  scene.threads = threads;
  const fs::path checkpoint = with_field ? RequireTrainedField(run) : fs::path();
  scene.train = with_field ? ReadTrainingScene(run) : io::ReadTransforms(train).scene;
  if (fs::is_regular_file(test)) scene.test = io::ReadTransforms(test).scene;
  scene.target = MakeTargetFrame(frame, scene.train.scene_from_sfm);
  if (with_field) {
    scene.field = nerf::TrainedField::Load(checkpoint);
    scene.support = std::make_unique<nerf::SupportMap>(*scene.field, scene.train, threads);
  }
  return scene;
}

std::vector<ExportedView> ViewsOf(const ExportedScene& scene) {
  std::vector<ExportedView> views;
  std::set<std::string> taken;
  for (const io::Scene* part : {&scene.train, &scene.test}) {
    for (const io::Frame& frame : part->frames) {
      std::string name = NameOf(scene.folder, frame.image_path);
      while (!taken.insert(name).second) name.insert(name.rfind('.'), "_");
      views.push_back(
          {&part->cameras[static_cast<std::size_t>(frame.camera_index)], &frame, name, part == &scene.test});
    }
  }
  return views;
}

}  // namespace pipeline
