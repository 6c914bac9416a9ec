#include "io/process/resource_meter.h"

#include <sys/resource.h>
#include <time.h>

#include <fstream>
#include <string>

namespace io {
namespace {

double CpuSeconds(__rusage_who_t who) {
  rusage usage = {};
  getrusage(who, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

double ProcessCpuSeconds() { return CpuSeconds(RUSAGE_SELF); }
double ProcessAndChildrenCpuSeconds() { return CpuSeconds(RUSAGE_SELF) + CpuSeconds(RUSAGE_CHILDREN); }

double ThreadCpuSeconds() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
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

ResourceMeter::ResourceMeter()
    : start_(std::chrono::steady_clock::now()), cpu_start_s_(ProcessAndChildrenCpuSeconds()) {
  std::ofstream("/proc/self/clear_refs") << "5";  // proc(5): resets the high-water mark
}

ResourceUse ResourceMeter::Use() const {
  return {.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(),
          .cpu_s = ProcessAndChildrenCpuSeconds() - cpu_start_s_,
          .peak_rss_bytes = PeakRssBytes()};
}

}  // namespace io
