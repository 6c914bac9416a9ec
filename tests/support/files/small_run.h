// A run folder whose field is trained for some steps on a ball, for tests of what looks at runs.
#pragma once

#include <string>

#include "io/base/hash.h"
#include "io/base/owned_folder.h"
#include "io/scene/transforms.h"
#include "nerf/training/trainer.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"

namespace tests {

class SmallRun {
 public:
  static constexpr int kViews = 8;

  SmallRun() : path_(dir_ / "a run") {
    io::ClaimFolder(path_);
    const std::filesystem::path folder = path_ / "scene";
    scene_ = BallScene(folder, kViews, 0);
    for (int i = 0; i < 50; ++i)
      scene_.points.push_back({.xyz = 0.8 * Eigen::Vector3d(std::cos(i), std::sin(i), 0.1 * std::sin(7 * i)),
                               .rgb = {200, 100, 50},
                               .frame_indices = {0, 1, 2}});
    io::WriteTransforms(folder / "transforms_train.json", scene_, "");
  }

  // Into `train`, or `.train.partial` as long as training goes on.
  void Train(const std::string& folder) const {
    nerf::TrainOptions options;
    options.steps = 60;
    options.samples_per_step = 2048;
    options.field.log2_hashmap_size = 10;
    options.field.finest_resolution = 32;
    options.field.grid_resolution = 64;
    std::filesystem::create_directories(path_ / folder);
    nerf::Train(scene_, {}, options, path_ / folder);
  }

  // What the stage would: which checkpoint was trained on what.
  void RecordTraining() const {
    WriteText(path_ / "train/train.json",
              "{\"outputs\": {\"checkpoint.bin\": \"" + io::HashFile(path_ / "train/checkpoint.bin") +
                  "\"}, \"inputs\": {\"scene/transforms_train.json\": \"" +
                  io::HashFile(path_ / "scene/transforms_train.json") + "\"}}");
  }

  const std::filesystem::path& path() const { return path_; }
  const io::Scene& scene() const { return scene_; }

 private:
  const TempDir dir_;
  const std::filesystem::path path_;
  io::Scene scene_;
};

}  // namespace tests
