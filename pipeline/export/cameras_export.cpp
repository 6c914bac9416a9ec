#include "pipeline/export/cameras_export.h"

#include <algorithm>

#include "io/process/interrupt.h"
#include "io/scene/colmap_model.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "pipeline/export/export_place.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

void CopyFile(const fs::path& from, const fs::path& to) {
  fs::create_directories(to.parent_path());
  fs::copy_file(from, to);
}

// The index of `camera` in scene->cameras, where it is added when it is new.
int IndexOf(const io::Camera& camera, io::Scene* scene) {
  const auto found = std::find(scene->cameras.begin(), scene->cameras.end(), camera);
  const auto index = found - scene->cameras.begin();
  if (found == scene->cameras.end()) scene->cameras.push_back(camera);
  return static_cast<int>(index);
}

// The views in the target frame, their pictures below `folder`, where they are copied to. Observers of the
// points stay right: training frames come first.
io::Scene PlaceViews(const ExportedScene& from, const fs::path& folder) {
  const io::Sim3d& target_from_scene = from.target.target_from_scene;
  io::Scene scene;
  if (from.target.IsScene()) {  // near, far and the rest hold in scene coordinates alone
    scene = from.train;
    scene.cameras.clear(), scene.frames.clear();
  }
  scene.points = from.train.points;
  for (io::Point3D& point : scene.points) point.xyz = target_from_scene * point.xyz;
  for (const ExportedView& view : ViewsOf(from)) {
    io::ThrowIfInterrupted();
    io::Frame frame{.image_path = folder / "images" / view.name,
                    .camera_index = IndexOf(*view.camera, &scene),
                    .world_from_cam = io::TransformPose(target_from_scene, view.frame->world_from_cam),
                    .mask_path = {}};
    CopyFile(view.frame->image_path, frame.image_path);
    if (!view.frame->mask_path.empty()) {
      frame.mask_path = folder / "masks" / view.name;
      CopyFile(view.frame->mask_path, frame.mask_path);
    }
    scene.frames.push_back(std::move(frame));
  }
  return scene;
}

io::Scene Part(const io::Scene& scene, std::size_t begin, std::size_t end) {
  io::Scene part = scene;
  part.frames.assign(scene.frames.begin() + static_cast<std::ptrdiff_t>(begin),
                     scene.frames.begin() + static_cast<std::ptrdiff_t>(end));
  return part;
}

io::ColmapModel ModelOf(io::Scene scene, const fs::path& pictures) {
  io::ColmapModel model;
  for (io::Frame& frame : scene.frames) frame.image_path = frame.image_path.lexically_relative(pictures);
  for (std::size_t i = 0; i < scene.points.size(); ++i) {
    for (const int frame : scene.points[i].frame_indices) {
      io::Observation observation{.frame_index = frame, .point_index = static_cast<int>(i)};
      const auto xy = io::Project(scene, observation);
      if (!xy) continue;
      observation.xy = *xy;
      model.observations.push_back(observation);
    }
  }
  model.scene = std::move(scene);
  return model;
}

}  // namespace

void ExportCameras(const ExportedScene& from, const fs::path& folder) {
  ExportFolder out(folder);
  const io::Scene scene = PlaceViews(from, out.path());
  const std::size_t n_train = from.train.frames.size(), n_all = scene.frames.size();
  if (!scene.points.empty()) io::WritePly(out.path() / "points.ply", scene.points);
  io::WriteTransforms(out.path() / "transforms.json", scene, scene.points.empty() ? "" : "points.ply");
  io::WriteBlenderTransforms(out.path() / "transforms_train.json", Part(scene, 0, n_train));
  if (n_all > n_train)
    io::WriteBlenderTransforms(out.path() / "transforms_test.json", Part(scene, n_train, n_all));
  const io::ColmapModel model = ModelOf(scene, out.path() / "images");
  io::WriteColmapModel(out.path() / "colmap_text", model, io::ColmapForm::kText);
  io::WriteColmapModel(out.path() / "colmap_bin", model, io::ColmapForm::kBinary);
  out.Commit("cameras", from.target);
}

}  // namespace pipeline
