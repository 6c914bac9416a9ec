// What there is to see of a run, followed while it changes: the scene as soon as there are poses, then the
// field of every checkpoint that training writes.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "io/scene/scene.h"
#include "nerf/rendering/support_map.h"
#include "nerf/rendering/trained_field.h"

namespace pipeline {

class LiveRun {
 public:
  struct Content {
    std::shared_ptr<const io::Scene> scene;           // training views; null: no poses yet
    std::shared_ptr<const nerf::TrainedField> field;  // null: not trained yet
    std::shared_ptr<const nerf::SupportMap> support;  // of a finished field, some seconds after it; else null
    std::uint64_t version = 0;                        // rises with every change
    bool is_finished = false;                         // the field is that of a training that ended
    bool is_training = false;                         // training goes on and knows that somebody looks
    std::string fault;                                // why something that is there cannot be shown
  };

  // Reads what is there already. Throws as the readers do when the run is finished but damaged, and
  // kBadInput when there is no folder.
  LiveRun(const std::filesystem::path& run_folder, int threads);
  ~LiveRun();

  Content Now() const;
  const std::filesystem::path& run_folder() const { return run_folder_; }
  // curve.csv of the training whose field is shown.
  std::filesystem::path CurvePath() const;

 private:
  void Follow();
  void Update();
  void ReadScene();
  void ReadField();
  void MapSupport();
  void Publish(Content content);

  const std::filesystem::path run_folder_;
  const int threads_;
  mutable std::mutex mutex_;
  Content content_;
  // Of the files that content_ was read from: name and time of the last change.
  std::string scene_read_, field_read_;
  std::atomic<bool> stop_ = false;
  std::thread follower_;
};

}  // namespace pipeline
