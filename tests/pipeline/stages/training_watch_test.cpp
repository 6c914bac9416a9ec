#include "pipeline/stages/training_watch.h"

#include <gtest/gtest.h>

#include <chrono>

#include "tests/support/files/temp_dir.h"

namespace pipeline {
namespace {

TEST(TrainingWatch, NothingIsAskedOrWrittenWhileNobodyLooks) {
  const TempDir run;
  const nerf::WatcherWish wish = WatcherOf(run.path())({.step = 3});
  EXPECT_FALSE(wish.wants_checkpoint);
  EXPECT_FALSE(wish.wants_end);
  EXPECT_FALSE(ReadTrainingNews(run.path()));
  EXPECT_EQ(CountEntries(run.path()), 0);
}

TEST(TrainingWatch, WhoLooksGetsNewsAndCheckpoints) {
  const TempDir run;
  const auto watcher = WatcherOf(run.path());
  KeepWatching(run.path());
  EXPECT_TRUE(watcher({.step = 3, .progress = 0.25, .left_s = 12, .train_psnr = 21.5}).wants_checkpoint);
  const auto news = ReadTrainingNews(run.path());
  ASSERT_TRUE(news);
  EXPECT_EQ(news->step, 3u);
  EXPECT_EQ(news->progress, 0.25);
  EXPECT_EQ(news->left_s, 12);
  EXPECT_EQ(news->train_psnr, 21.5);
}

TEST(TrainingWatch, LookingAwayEndsIt) {
  const TempDir run;
  const auto watcher = WatcherOf(run.path());
  KeepWatching(run.path());
  watcher({.step = 1});
  const auto before = std::filesystem::file_time_type::clock::now() -
                      std::chrono::milliseconds(static_cast<int>(1001 * kWatchLasts_s));
  for (const char* name : {"watched", "training.json"})
    std::filesystem::last_write_time(run.path() / ".view" / name, before);
  EXPECT_FALSE(watcher({.step = 2}).wants_checkpoint);
  EXPECT_FALSE(ReadTrainingNews(run.path()));
}

TEST(TrainingWatch, EndIsAskedOnceAndOnlyOfTheTrainingThatGoesOn) {
  const TempDir run;
  AskToEnd(run.path());
  const auto watcher = WatcherOf(run.path());  // a new training: the request was not meant for it
  KeepWatching(run.path());
  EXPECT_FALSE(watcher({}).wants_end);
  AskToEnd(run.path());
  EXPECT_TRUE(watcher({}).wants_end);
  EXPECT_FALSE(watcher({}).wants_end);
}

}  // namespace
}  // namespace pipeline
