// Progress of long work on stderr: a live line with ETA on a terminal, a plain line every few seconds
// otherwise. Of several ranks (ranks.h) the first shows its own.
#pragma once

#include <chrono>
#include <string>

namespace io {

class Progress {
 public:
  explicit Progress(std::string title);
  ~Progress();  // ends the live line

  // fraction in [0, 1]; note: what a user wants to see beside it ("24.1 dB, 310 k rays/s").
  void Update(double fraction, const std::string& note = "");

 private:
  std::string title_;
  bool is_terminal_;
  bool shown_ = false;
  double first_fraction_ = 0;  // of the first update: resumed work starts above 0
  std::chrono::steady_clock::time_point start_, first_shown_, last_shown_;
};

// "1 h 02 min", "3 min 05 s", "4.2 s".
std::string FormatDuration(double seconds);

}  // namespace io
