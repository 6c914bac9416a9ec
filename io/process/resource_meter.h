// What a piece of work costs: wall clock, processor time and memory.
#pragma once

#include <chrono>
#include <cstddef>

namespace io {

// Processor seconds of this process, all threads, user and system; with those of the children that ended.
double ProcessCpuSeconds();
double ProcessAndChildrenCpuSeconds();
// Of the calling thread alone. Other jobs on the machine do not count, but what they take of shared caches
// and of the clock still does.
double ThreadCpuSeconds();

// Most memory that this process has held, since its start or the last ResourceMeter.
std::size_t PeakRssBytes();

struct ResourceUse {
  double wall_s = 0;
  double cpu_s = 0;                // user and system, all threads, with the children that ended meanwhile
  std::size_t peak_rss_bytes = 0;  // of this process alone
};

class ResourceMeter {
 public:
  // Lets Linux count the peak anew (/proc/self/clear_refs); where it refuses, the peak is that of the whole
  // process so far.
  ResourceMeter();

  // Since construction.
  ResourceUse Use() const;

 private:
  std::chrono::steady_clock::time_point start_;
  double cpu_start_s_;
};

}  // namespace io
