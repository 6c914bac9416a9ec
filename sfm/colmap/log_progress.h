// How far a program has come that tells it by lines of its log.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "io/process/progress.h"

namespace sfm {

// Counts the lines with `marker` that are appended to a log from now on.
class LogCounter {
 public:
  LogCounter(std::filesystem::path log, std::string marker);
  int Count();

 private:
  std::filesystem::path log_;
  std::string marker_;
  std::streamoff offset_;
  int count_ = 0;
};

// Shows the count as progress; `done_before` of `total` were finished earlier.
class LogProgress {
 public:
  LogProgress(const std::filesystem::path& log,
              const std::string& title,
              std::string marker,
              int done_before,
              int total);
  void Tick();
  void Finish();

 private:
  void Show(double fraction);

  LogCounter counter_;
  io::Progress progress_;
  int done_before_, done_, total_;
};

}  // namespace sfm
