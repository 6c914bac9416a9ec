#include "pipeline/stages/training_watch.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"
#include "io/base/owned_folder.h"
#include "pipeline/stage/run_record.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Json;

constexpr std::size_t kMaxNewsBytes = 4096;

fs::path WatchFile(const fs::path& run_folder, const char* name) { return run_folder / ".view" / name; }

// Whether the file was written within kWatchLasts_s.
bool IsFresh(const fs::path& path) {
  std::error_code error;
  const auto written = fs::last_write_time(path, error);
  if (error) return false;
  return fs::file_time_type::clock::now() - written < std::chrono::duration<double>(kWatchLasts_s);
}

void WriteNews(const fs::path& path, const nerf::TrainingNews& news) {
  const Json json = {{"step", news.step},
                     {"progress", news.progress},
                     {"elapsed_s", news.elapsed_s},
                     {"left_s", news.left_s},
                     {"train_psnr", news.train_psnr},
                     {"heldout_psnr", news.heldout_psnr}};
  io::WriteFileAtomically(path, io::DumpJson(json));
}

}  // namespace

std::function<nerf::WatcherWish(const nerf::TrainingNews&)> WatcherOf(const fs::path& run_folder) {
  std::error_code error;
  fs::remove(WatchFile(run_folder, "end"), error);
  return [run_folder](const nerf::TrainingNews& news) {
    if (!IsFresh(WatchFile(run_folder, "watched"))) return nerf::WatcherWish{};
    try {
      WriteNews(WatchFile(run_folder, "training.json"), news);
    } catch (const io::Error&) {  // who looks learns less; training goes on
    }
    std::error_code ignored;
    return nerf::WatcherWish{.wants_checkpoint = true,
                             .wants_end = fs::remove(WatchFile(run_folder, "end"), ignored)};
  };
}

void KeepWatching(const fs::path& run_folder) {
  const fs::path path = WatchFile(run_folder, "watched");
  std::error_code error;
  fs::last_write_time(path, fs::file_time_type::clock::now(), error);
  if (!error) return;
  io::ClaimFolder(run_folder / ".view");
  io::WriteFileAtomically(path, "");
}

void AskToEnd(const fs::path& run_folder) {
  io::ClaimFolder(run_folder / ".view");
  io::WriteFileAtomically(WatchFile(run_folder, "end"), "");
}

std::optional<nerf::TrainingNews> ReadTrainingNews(const fs::path& run_folder) {
  const fs::path path = WatchFile(run_folder, "training.json");
  if (!IsFresh(path)) return std::nullopt;
  const Json json = io::ParseJson(io::ReadFile(path, kMaxNewsBytes));
  return nerf::TrainingNews{.step = static_cast<std::uint64_t>(std::max(0.0, NumberAt(json, "step"))),
                            .progress = NumberAt(json, "progress"),
                            .elapsed_s = NumberAt(json, "elapsed_s"),
                            .left_s = NumberAt(json, "left_s"),
                            .train_psnr = NumberAt(json, "train_psnr"),
                            .heldout_psnr = NumberAt(json, "heldout_psnr")};
}

}  // namespace pipeline
