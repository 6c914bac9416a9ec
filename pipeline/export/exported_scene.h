// What all exporters work on: the views and the field of a run, and the frame that they are written in.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/scene/scene.h"
#include "nerf/rendering/support_map.h"
#include "nerf/rendering/trained_field.h"
#include "nerf/sampling/crop_box.h"
#include "pipeline/export/target_frame.h"

namespace pipeline {

struct ExportedScene {
  std::string name;                           // of the run
  std::filesystem::path folder;               // <run>/scene
  io::Scene train, test;                      // in scene coordinates; test may be without frames
  std::unique_ptr<nerf::TrainedField> field;  // null: not asked for
  std::unique_ptr<nerf::SupportMap> support;  // with the field
  TargetFrame target;
  std::optional<nerf::CropBox> crop;  // of what the field shows, scene coordinates
  int threads = 1;
};

// Throws kBadInput when the run lacks the scene or, where it is asked for, the field; kBadState when the
// field was trained on another scene.
ExportedScene LoadExportedScene(const std::filesystem::path& run_folder,
                                const FrameOptions& frame,
                                bool with_field,
                                int threads);

// The run's checkpoint. Throws kBadInput when there is none, kBadState when it was trained on another scene.
std::filesystem::path RequireTrainedField(const std::filesystem::path& run_folder);

struct ExportedView {
  const io::Camera* camera;
  const io::Frame* frame;
  // Of its picture, relative to the folder of pictures: "IMG_1.png", "train/r_0.png". Blanks are replaced, at
  // which COLMAP's reader of text would end the name.
  std::string name;
  bool is_test;
};

// Training views, then test views.
std::vector<ExportedView> ViewsOf(const ExportedScene& scene);

}  // namespace pipeline
