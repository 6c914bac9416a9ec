#include "io/resource_meter.h"

#include <sys/resource.h>

#include <fstream>
#include <string>

namespace io {
namespace {

double CpuSeconds() {
  double sum = 0;
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage = {};
    getrusage(who, &usage);
    for (const timeval& t : {usage.ru_utime, usage.ru_stime})
      sum += static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  }
  return sum;
}

// VmHWM, the high-water mark of the resident set.
std::size_t PeakRssBytes() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::size_t kib = 0;
    if (word == "VmHWM:" && status >> kib) return kib * 1024;
  }
  return 0;
}

}  // namespace

ResourceMeter::ResourceMeter() : start_(std::chrono::steady_clock::now()), cpu_start_s_(CpuSeconds()) {
  std::ofstream("/proc/self/clear_refs") << "5";  // proc(5): resets the high-water mark
}

ResourceUse ResourceMeter::Use() const {
  return {.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(),
          .cpu_s = CpuSeconds() - cpu_start_s_,
          .peak_rss_bytes = PeakRssBytes()};
}

}  // namespace io
