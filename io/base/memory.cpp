#include "io/base/memory.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <new>
#include <optional>
#include <sstream>

#include "io/base/error.h"

namespace io {
namespace {

namespace fs = std::filesystem;

// What no plan counts: fragments of the heap, and pages of libraries that are touched later.
constexpr std::size_t kSlack = std::size_t{48} << 20;

std::atomic<std::size_t> memory_limit = SIZE_MAX;  // of LimitMemory

// "VmRSS:  1024 kB" of a file in /proc, in bytes; 0 where it is missing.
std::size_t ProcBytes(const char* file, const std::string& key) {
  std::ifstream in(file);
  for (std::string word; in >> word;) {
    std::size_t kib = 0;
    if (word == key + ":" && in >> kib) return kib * 1024;
  }
  return 0;
}

std::optional<std::size_t> NumberIn(const fs::path& file) {
  std::size_t number = 0;
  std::ifstream in(file);
  if (!(in >> number)) return std::nullopt;  // "max" is no number
  return number;
}

// What a control group and those above it leave: `limit_file` less `usage_file`.
std::size_t LeftInGroups(const fs::path& root,
                         const fs::path& group,
                         const char* limit_file,
                         const char* usage_file) {
  std::size_t left = SIZE_MAX;
  for (fs::path at = group.relative_path();; at = at.parent_path()) {
    const auto most = NumberIn(root / at / limit_file), used = NumberIn(root / at / usage_file);
    if (most && used) left = std::min(left, *most - std::min(*most, *used));
    if (at.empty()) return left;
  }
}

std::size_t Sum(std::size_t a, std::size_t b) { return a > SIZE_MAX - b ? SIZE_MAX : a + b; }

}  // namespace

std::size_t FreeMemoryBytes() {
  std::size_t free = ProcBytes("/proc/meminfo", "MemAvailable");
  std::ifstream groups("/proc/self/cgroup");  // "4:memory:/a/b", or "0::/a/b" of the unified hierarchy
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string kinds = line.substr(first + 1, second - first - 1), group = line.substr(second + 1);
    if (kinds.empty())
      free = std::min(free, LeftInGroups("/sys/fs/cgroup", group, "memory.max", "memory.current"));
    if (kinds == "memory")
      free = std::min(
          free,
          LeftInGroups("/sys/fs/cgroup/memory", group, "memory.limit_in_bytes", "memory.usage_in_bytes"));
  }
  return free;
}

std::size_t HeldMemoryBytes() { return ProcBytes("/proc/self/status", "VmRSS"); }

void MemoryBudget::Require(std::size_t more, const std::string& work) const {
  const std::size_t need = Sum(Sum(more, HeldMemoryBytes()), kSlack);
  if (need <= bytes_) return;
  throw Error(
      ExitCode::kNoResources,
      fmt::format("{} needs about {} of memory, and may take {}", work, MemoryText(need), MemoryText(bytes_)),
      "Give it more by --memory, or use fewer or smaller pictures");
}

int MemoryBudget::AtOnce(int most, std::size_t each, std::size_t more, const std::string& work) const {
  Require(Sum(each, more), work);
  return Fits(most, each, more);
}

int MemoryBudget::Fits(int most, std::size_t each, std::size_t more) const {
  const std::size_t taken = Sum(Sum(more, HeldMemoryBytes()), kSlack),
                    left = bytes_ - std::min(bytes_, taken);
  const std::size_t fitting = left / std::max<std::size_t>(1, each);
  return static_cast<int>(std::clamp<std::size_t>(fitting, 1, static_cast<std::size_t>(std::max(1, most))));
}

void LimitMemory(const MemoryBudget& budget, int threads) {
  const char* const status = "/proc/self/status";
  const std::size_t untouched =
      ProcBytes(status, "VmData") - std::min(ProcBytes(status, "VmData"), ProcBytes(status, "RssAnon"));
  const std::size_t libraries = Sum(ProcBytes(status, "RssFile"), kSlack / 2);
  rlimit stack;
  const bool has_stack = getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur != RLIM_INFINITY;
  const std::size_t stacks = has_stack ? static_cast<std::size_t>(threads) * stack.rlim_cur : 0;
  memory_limit = budget.bytes();
  rlimit data;
  if (getrlimit(RLIMIT_DATA, &data) != 0) return;
  data.rlim_cur = std::min<rlim_t>(
      data.rlim_max, Sum(Sum(budget.bytes() - std::min(budget.bytes(), libraries), untouched), stacks));
  setrlimit(RLIMIT_DATA, &data);
}

std::size_t MemoryLeftBytes() {
  return memory_limit == SIZE_MAX ? SIZE_MAX
                                  : memory_limit - std::min<std::size_t>(memory_limit, HeldMemoryBytes());
}

void ThrowIfMemoryWasRefused() {
  if (errno == ENOMEM) throw std::bad_alloc();
}

std::string MemoryText(std::size_t bytes) {
  const double mib = static_cast<double>(bytes) / (1 << 20);
  return mib < 999.5 ? fmt::format("{:.0f} MiB", mib) : fmt::format("{:.1f} GiB", mib / 1024);
}

}  // namespace io
