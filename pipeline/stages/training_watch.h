// Between `pipeline train` and who looks at it with `pipeline view`: two programs, which share the run folder
// and nothing else. Files in its hidden folder .view say that somebody looks, that training shall end now,
// and how it goes.
#pragma once

#include <filesystem>
#include <optional>

#include "nerf/training/trainer.h"

namespace pipeline {

// Of training: forgets a request to end that an earlier training was meant to get, and returns what tells of
// the training while somebody looks and asks for what they want.
std::function<nerf::WatcherWish(const nerf::TrainingNews&)> WatcherOf(
    const std::filesystem::path& run_folder);

// Of the view. KeepWatching is to be repeated at least every kWatchLasts_s.
void KeepWatching(const std::filesystem::path& run_folder);
void AskToEnd(const std::filesystem::path& run_folder);
// What a training that is going on told last; nothing when none is, or none was told that somebody looks.
std::optional<nerf::TrainingNews> ReadTrainingNews(const std::filesystem::path& run_folder);

inline constexpr double kWatchLasts_s = 5;

}  // namespace pipeline
