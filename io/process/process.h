// Runs an external program: argument vector only (no shell), own process group, wall-clock and memory limits,
// and a log file that takes stdout and stderr. What LimitMemory (io/base/memory.h) leaves limits the child
// as well. Success is not trusted: callers verify the product.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace io {

struct ProcessOptions {
  double timeout_s = 0;               // wall clock; 0: none. The whole process group is killed at the limit.
  double grace_s = 2;                 // between the request to stop and SIGKILL
  std::size_t memory_bytes = 0;       // RLIMIT_AS; 0: none
  std::filesystem::path log_path;     // receives stdout and stderr; empty: inherited
  std::filesystem::path working_dir;  // empty: inherited
  std::function<void()> on_tick;      // called about five times a second while the child runs
};

struct ProcessReport {
  int exit_code = -1;  // valid when signal == 0
  int signal = 0;
  bool timed_out = false;
  double wall_s = 0, cpu_s = 0;
  std::size_t peak_rss_bytes = 0;

  bool Ok() const { return exit_code == 0 && signal == 0 && !timed_out; }
};

// Absolute path of a program on PATH, or nothing.
std::optional<std::filesystem::path> FindProgram(const std::string& name);

// argv[0] is the program's path. When a signal is pending (io/process/interrupt.h) the child's group gets the
// same signal, then SIGKILL after grace_s, and io::Interrupted is thrown; an exception out of on_tick ends
// the child likewise. The child reads /dev/null and is killed when the calling thread dies. Throws
// kMissingTool when the program cannot be started.
ProcessReport RunProcess(const std::vector<std::string>& argv, const ProcessOptions& options);

// Everything that a program prints within timeout_s, however it ends.
std::string OutputOf(const std::vector<std::string>& argv, double timeout_s);

// The last lines of a log, for messages.
std::string LogTail(const std::filesystem::path& log_path, int lines);

}  // namespace io
