#include "io/process/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "io/process/ranks.h"

namespace io {
namespace {

constexpr std::chrono::milliseconds kTerminalInterval(200);
constexpr std::chrono::milliseconds kPlainInterval(10000);
constexpr double kMinShareForEta = 0.01;  // less work than this predicts nothing

}  // namespace

Progress::Progress(std::string title)
    : title_(std::move(title)),
      is_terminal_(isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()) {}

Progress::~Progress() {
  if (shown_ && is_terminal_) std::fputc('\n', stderr);
}

void Progress::Update(double fraction, const std::string& note) {
  if (!AllRanks().IsFirst()) return;
  const auto now = std::chrono::steady_clock::now();
  const bool finished = fraction >= 1.0;
  if (shown_ && !finished && now - last_shown_ < (is_terminal_ ? kTerminalInterval : kPlainInterval)) return;
  if (!shown_) {
    first_fraction_ = fraction;
    first_shown_ = now;
  }
  shown_ = true;
  last_shown_ = now;
  const double elapsed = std::chrono::duration<double>(now - start_).count();
  const double since_first = std::chrono::duration<double>(now - first_shown_).count();
  const double share = std::clamp(fraction, 0.0, 1.0);
  std::string eta = "ETA --";
  if (finished) {
    eta = "in " + FormatDuration(elapsed);
  } else if (share > first_fraction_ + kMinShareForEta) {
    eta = "ETA " + FormatDuration(since_first * (1.0 - share) / (share - first_fraction_));
  }
  const std::string line = fmt::format("{} {:3.0f} %  {}  {}", title_, 100 * share, eta, note);
  std::fputs((is_terminal_ ? "\r\033[K" + line : line + "\n").c_str(), stderr);
  std::fflush(stderr);
}

std::string FormatDuration(double seconds) {
  const long whole = std::lround(seconds);
  if (whole >= 3600) return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
  if (whole >= 60) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{:.1f} s", seconds);
}

}  // namespace io
