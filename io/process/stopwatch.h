// Wall time of a piece of work. Unlike io::ResourceMeter it can be nested.
#pragma once

#include <chrono>

namespace io {

class Stopwatch {
 public:
  // Since construction.
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace io
