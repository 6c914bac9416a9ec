#include "pipeline/view/live_run.h"

#include <chrono>

#include "io/base/error.h"
#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "io/scene/transforms.h"
#include "pipeline/stages/torch_program.h"
#include "pipeline/stages/training_watch.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

constexpr auto kLookEvery = std::chrono::milliseconds(300);

// Tells one version of a file from another; empty when there is none.
std::string VersionOf(const fs::path& path) {
  std::error_code error;
  const auto written = fs::last_write_time(path, error);
  if (error) return "";
  return path.string() + " " + std::to_string(written.time_since_epoch().count());
}

}  // namespace

LiveRun::LiveRun(const fs::path& run_folder, int threads) : run_folder_(run_folder), threads_(threads) {
  if (!fs::is_directory(run_folder))
    throw io::Error(io::ExitCode::kBadInput, run_folder.string() + ": no such folder", "Give a run folder");
  Update();
  follower_ = std::thread([this] { Follow(); });
}

LiveRun::~LiveRun() {
  stop_ = true;
  follower_.join();
}

LiveRun::Content LiveRun::Now() const {
  const bool is_training = ReadTrainingNews(run_folder_).has_value();
  const std::lock_guard lock(mutex_);
  Content content = content_;
  content.is_training = is_training;
  return content;
}

fs::path LiveRun::CurvePath() const {
  return run_folder_ / (Now().is_finished ? "train" : ".train.partial") / "curve.csv";
}

void LiveRun::Publish(Content content) {
  const std::lock_guard lock(mutex_);
  content.version = content_.version + 1;
  content_ = std::move(content);
}

void LiveRun::Follow() {
  io::GiveWay();
  while (!stop_) {
    try {
      std::this_thread::sleep_for(kLookEvery);
      Update();
      MapSupport();
    } catch (const io::Interrupted&) {
      return;
    } catch (const std::exception& error) {
      // A stage may have replaced its folder just now; what stays unreadable is named on the page.
      Content content = Now();
      if (content.fault == error.what()) continue;
      content.fault = error.what();
      Publish(std::move(content));
    }
  }
}

void LiveRun::Update() {
  ReadScene();
  if (content_.scene) ReadField();
}

void LiveRun::ReadScene() {
  const fs::path path = run_folder_ / "scene/transforms_train.json";
  const std::string version = VersionOf(path);
  if (version == scene_read_ || version.empty()) return;
  Content content;
  content.scene = std::make_shared<io::Scene>(io::ReadTransforms(path).scene);
  scene_read_ = version;
  field_read_.clear();
  Publish(std::move(content));
}

void LiveRun::ReadField() {
  const fs::path partial = run_folder_ / ".train.partial/checkpoint.bin",
                 finished = run_folder_ / "train/checkpoint.bin";
  const bool is_finished = !fs::is_regular_file(partial);
  const fs::path& path = is_finished ? finished : partial;
  const std::string version = VersionOf(path);
  if (version == field_read_ || version.empty()) return;
  if (NeedsTorch(path))
    throw io::Error(io::ExitCode::kBadInput,
                    path.string() + ": the `nerf` field is too slow to look around in",
                    "Train with --field hash");
  Content content = Now();
  content.field = nerf::TrainedField::Load(path);
  content.support.reset();
  content.is_finished = is_finished;
  content.fault.clear();
  field_read_ = version;
  Publish(std::move(content));
}

void LiveRun::MapSupport() {
  Content content = Now();
  if (!content.is_finished || !content.field || content.support) return;
  content.support = std::make_shared<nerf::SupportMap>(*content.field, *content.scene, threads_);
  Publish(std::move(content));
}

}  // namespace pipeline
