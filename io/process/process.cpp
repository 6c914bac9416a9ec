#include "io/process/process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <sstream>
#include <thread>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/memory.h"
#include "io/process/interrupt.h"

namespace io {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kPoll = std::chrono::milliseconds(20);
constexpr int kExecFailed = 127;

// Only async-signal-safe calls are allowed between fork and exec.
[[noreturn]] void ExecChild(char* const* argv,
                            const ProcessOptions& options,
                            std::size_t memory_left,
                            int log_fd,
                            const char* dir,
                            pid_t parent) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(kExecFailed);  // the parent died before the line above
  signal(SIGPIPE, SIG_DFL);
  const rlimit no_core = {0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  if (options.memory_bytes > 0) {
    const rlimit limit = {options.memory_bytes, options.memory_bytes};
    setrlimit(RLIMIT_AS, &limit);
  }
  rlimit data;
  if (memory_left != SIZE_MAX && getrlimit(RLIMIT_DATA, &data) == 0) {
    data.rlim_cur = std::min<rlim_t>(memory_left, data.rlim_max);
    setrlimit(RLIMIT_DATA, &data);
  }
  if (log_fd >= 0) {
    dup2(log_fd, STDOUT_FILENO);
    dup2(log_fd, STDERR_FILENO);
  }
  const int null_fd = open("/dev/null", O_RDONLY);
  if (null_fd >= 0) dup2(null_fd, STDIN_FILENO);
  if (*dir != '\0' && chdir(dir) != 0) _exit(kExecFailed);
  execv(argv[0], argv);
  _exit(kExecFailed);
}

void KillGroup(pid_t pid, int signal_number, double grace_s, int* status, rusage* usage) {
  kill(-pid, signal_number);
  const auto start = Clock::now();
  while (std::chrono::duration<double>(Clock::now() - start).count() < grace_s) {
    if (wait4(pid, status, WNOHANG, usage) == pid) {
      kill(-pid, SIGKILL);
      return;
    }
    std::this_thread::sleep_for(kPoll);
  }
  kill(-pid, SIGKILL);
  wait4(pid, status, 0, usage);
}

}  // namespace

std::optional<std::filesystem::path> FindProgram(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "/usr/local/bin:/usr/bin:/bin");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::filesystem::path candidate = std::filesystem::path(folder) / name;
    std::error_code ignored;
    if (!folder.empty() && std::filesystem::is_regular_file(candidate, ignored) &&
        access(candidate.c_str(), X_OK) == 0) {
      return std::filesystem::absolute(candidate);
    }
  }
  return std::nullopt;
}

ProcessReport RunProcess(const std::vector<std::string>& argv, const ProcessOptions& options) {
  int log_fd = -1;
  if (!options.log_path.empty()) {
    log_fd = open(options.log_path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    if (log_fd < 0) throw Error(ExitCode::kNoResources, options.log_path.string() + ": cannot be created");
  }
  std::vector<char*> arguments;
  for (const std::string& argument : argv) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);

  const std::size_t memory_left = MemoryLeftBytes();
  const auto start = Clock::now();
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid == 0)
    ExecChild(arguments.data(), options, memory_left, log_fd, options.working_dir.c_str(), parent);
  if (log_fd >= 0) close(log_fd);
  if (pid < 0) throw Error(ExitCode::kNoResources, argv[0] + ": cannot start a process");
  setpgid(pid, pid);

  int status = 0;
  rusage usage = {};
  ProcessReport report;
  auto next_tick = start;
  try {
    while (wait4(pid, &status, WNOHANG, &usage) != pid) {
      ThrowIfInterrupted();
      const auto now = Clock::now();
      report.timed_out =
          options.timeout_s > 0 && std::chrono::duration<double>(now - start).count() > options.timeout_s;
      if (report.timed_out) {
        KillGroup(pid, SIGTERM, options.grace_s, &status, &usage);
        break;
      }
      if (options.on_tick && now >= next_tick) {
        options.on_tick();
        next_tick = now + 10 * kPoll;
      }
      std::this_thread::sleep_for(kPoll);
    }
  } catch (...) {
    KillGroup(pid, PendingInterrupt() ? PendingInterrupt() : SIGTERM, options.grace_s, &status, &usage);
    throw;
  }
  report.wall_s = std::chrono::duration<double>(Clock::now() - start).count();
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  report.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  report.peak_rss_bytes = static_cast<std::size_t>(usage.ru_maxrss) * 1024;
  if (WIFSIGNALED(status)) {
    report.signal = WTERMSIG(status);
  } else {
    report.exit_code = WEXITSTATUS(status);
  }
  if (report.exit_code == kExecFailed) throw Error(ExitCode::kMissingTool, argv[0] + ": cannot be started");
  return report;
}

std::string OutputOf(const std::vector<std::string>& argv, double timeout_s) {
  std::string log = (std::filesystem::temp_directory_path() / "pipeline_output_XXXXXX").string();
  const int fd = mkstemp(log.data());
  if (fd < 0) throw Error(ExitCode::kNoResources, log + ": cannot be created", "Set TMPDIR");
  close(fd);
  try {
    RunProcess(argv, {.timeout_s = timeout_s, .log_path = log});
  } catch (...) {
    std::filesystem::remove(log);
    throw;
  }
  const std::string text = ReadFile(log);
  std::filesystem::remove(log);
  return text;
}

std::string LogTail(const std::filesystem::path& log_path, int lines) {
  std::ifstream in(log_path);
  std::deque<std::string> tail;
  for (std::string line; std::getline(in, line);) {
    tail.push_back(line.substr(0, 300));
    if (static_cast<int>(tail.size()) > lines) tail.pop_front();
  }
  std::string text;
  for (const std::string& line : tail) text += line + "\n";
  return text;
}

}  // namespace io
