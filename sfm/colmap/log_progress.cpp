#include "sfm/colmap/log_progress.h"

#include <fmt/format.h>

#include <algorithm>

namespace sfm {

namespace fs = std::filesystem;

LogCounter::LogCounter(fs::path log, std::string marker)
    : log_(std::move(log)),
      marker_(std::move(marker)),
      offset_(fs::exists(log_) ? static_cast<std::streamoff>(fs::file_size(log_)) : 0) {}

int LogCounter::Count() {
  std::ifstream in(log_);
  in.seekg(offset_);
  for (std::string line;
       std::getline(in, line) && !in.eof();) {  // a line without its end is read again later
    offset_ = in.tellg();
    count_ += line.find(marker_) != std::string::npos;
  }
  return count_;
}

LogProgress::LogProgress(
    const fs::path& log, const std::string& title, std::string marker, int done_before, int total)
    : counter_(log, std::move(marker)),
      progress_(title),
      done_before_(done_before),
      done_(done_before),
      total_(total) {}

void LogProgress::Tick() {
  done_ = done_before_ + counter_.Count();
  Show(std::min(0.99, static_cast<double>(done_) / std::max(1, total_)));
}

void LogProgress::Finish() {
  Tick();
  if (done_ >= total_) Show(1.0);
}

void LogProgress::Show(double fraction) {
  progress_.Update(fraction, fmt::format("{} of {}", done_, total_));
}

}  // namespace sfm
