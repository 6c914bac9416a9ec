// io/process/process.h and io/process/interrupt.h: arguments arrive verbatim, limits hold, and nothing
// survives its parent.
#include "io/process/process.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <thread>

#include "io/base/error.h"
#include "io/process/interrupt.h"
#include "tests/support/files/temp_dir.h"

namespace {

using io::ExitCode;
using io::ProcessOptions;
using io::ProcessReport;
using io::RunProcess;

std::string Shell() { return io::FindProgram("sh").value().string(); }

bool IsAlive(pid_t pid) {
  if (kill(pid, 0) != 0) return false;
  const std::string stat = ReadText("/proc/" + std::to_string(pid) + "/stat");
  return stat.find(") Z ") == std::string::npos;  // a zombie is dead
}

// However long a busy machine takes for it; ctest ends a test that waits in vain.
void WaitUntil(const std::function<bool()>& happened) {
  while (!happened()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

// The pid that a child wrote, once the file is complete.
pid_t ReadPid(const std::filesystem::path& path) {
  WaitUntil([&] { return ReadText(path).ends_with('\n'); });
  return std::stoi(ReadText(path));
}

// Children of these tests would sleep for an hour: one that is gone was ended.
void WaitForDeath(pid_t pid) {
  WaitUntil([&] { return !IsAlive(pid); });
}

// Whether a signal was sent to the process and has not reached its handler yet: proc(5), ShdPnd.
bool IsPending(pid_t pid, int signal_number) {
  const std::string status = ReadText("/proc/" + std::to_string(pid) + "/status"), key = "ShdPnd:";
  const std::size_t at = status.find(key);
  if (at == std::string::npos) return false;
  return (std::stoull(status.substr(at + key.size()), nullptr, 16) >> (signal_number - 1) & 1) != 0;
}

TEST(Process, ArgumentsArriveVerbatim) {
  const TempDir dir;
  const std::vector<std::string> awkward = {"",
                                            " ",
                                            "a b",
                                            "'",
                                            "\"",
                                            "\\",
                                            "$(touch x)",
                                            "`id`",
                                            "*",
                                            ";",
                                            "&&",
                                            "--",
                                            "-n",
                                            "new\nline",
                                            "\xff",
                                            "ü"};
  std::vector<std::string> argv = {io::FindProgram("printf").value().string(), "<%s>"};
  argv.insert(argv.end(), awkward.begin(), awkward.end());
  const ProcessReport report = RunProcess(argv, {.log_path = dir / "log", .working_dir = dir.path()});
  EXPECT_TRUE(report.Ok());
  std::string expected;
  for (const std::string& argument : awkward) expected += "<" + argument + ">";
  EXPECT_EQ(ReadText(dir / "log"), expected);
  EXPECT_EQ(CountEntries(dir.path()), 1);  // only the log: nothing was interpreted
}

TEST(Process, ReportsExitCodesSignalsAndUse) {
  const TempDir dir;
  EXPECT_EQ(RunProcess({Shell(), "-c", "exit 3"}, {}).exit_code, 3);
  const ProcessReport killed = RunProcess({Shell(), "-c", "kill -9 $$"}, {});
  EXPECT_EQ(killed.signal, SIGKILL);
  EXPECT_FALSE(killed.Ok());
  const ProcessReport busy =
      RunProcess({Shell(), "-c", "i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done; pwd; echo e >&2"},
                 {.log_path = dir / "log", .working_dir = "/"});
  EXPECT_GT(busy.cpu_s, 0.01);
  EXPECT_GT(busy.peak_rss_bytes, 100000u);
  EXPECT_GE(busy.wall_s, 0.9 * busy.cpu_s);
  EXPECT_EQ(ReadText(dir / "log"), "/\ne\n");
}

TEST(Process, WhatIsMissingIsNamed) {
  EXPECT_ERROR(RunProcess({"/nonexistent/colmap"}, {}), ExitCode::kMissingTool, "/nonexistent/colmap");
  EXPECT_ERROR(RunProcess({"/etc/passwd"}, {}), ExitCode::kMissingTool, "/etc/passwd");
  EXPECT_ERROR(RunProcess({"/bin/true"}, {.log_path = "/nonexistent/log"}),
               ExitCode::kNoResources,
               "/nonexistent/log: cannot be created");
  EXPECT_FALSE(io::FindProgram("no-such-program").has_value());
  EXPECT_TRUE(io::FindProgram("sh")->is_absolute());
}

TEST(Process, TimeoutEndsTheWholeGroup) {
  const TempDir dir;
  const std::string script =
      "trap '' TERM; sleep 3600 & echo $! > " + (dir / "pid").string() + "; wait; sleep 3600";
  ProcessReport report;
  // A busy machine may need longer to get as far as `wait`.
  for (double timeout_s = 0.3; !ReadText(dir / "pid").ends_with('\n'); timeout_s *= 2) {
    report = RunProcess({Shell(), "-c", script}, {.timeout_s = timeout_s, .grace_s = 0.2});
  }
  EXPECT_TRUE(report.timed_out);
  EXPECT_FALSE(report.Ok());
  EXPECT_EQ(report.signal, SIGKILL) << "what ignores SIGTERM is killed after the grace";
  EXPECT_LT(report.wall_s, 3600);
  WaitForDeath(ReadPid(dir / "pid"));
}

TEST(Process, MemoryLimitHolds) {
#if defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "address-space limits and AddressSanitizer exclude each other";
#endif
  const TempDir dir;
  const std::vector<std::string> argv = {
      io::FindProgram("head").value().string(), "-c", "1000000000", "/dev/zero"};
  const std::string hog = "x=$(" + argv[0] + " -c 300000000 /dev/zero | tr '\\0' a); echo ${#x}";
  EXPECT_TRUE(RunProcess({Shell(), "-c", hog}, {.log_path = dir / "free"}).Ok());
  EXPECT_EQ(ReadText(dir / "free"), "300000000\n");
  const ProcessReport limited =
      RunProcess({Shell(), "-c", hog}, {.memory_bytes = 100 << 20, .log_path = dir / "limited"});
  EXPECT_FALSE(limited.Ok());
}

TEST(Process, TicksWhileTheChildRunsAndAThrowingTickEndsIt) {
  const TempDir dir;
  int ticks = 0;
  const auto end_at_the_third = [&] {
    if (++ticks == 3) WriteText(dir / "enough", "");
  };
  const std::string until_enough = "while ! [ -e " + (dir / "enough").string() + " ]; do sleep 0.02; done";
  EXPECT_TRUE(RunProcess({Shell(), "-c", until_enough}, {.on_tick = end_at_the_third}).Ok());
  EXPECT_GE(ticks, 3);
  const std::string script = "echo $$ > " + (dir / "pid").string() + "; exec sleep 3600";
  const auto stop = [&] {
    ReadPid(dir / "pid");
    throw io::Error(ExitCode::kNumeric, "stop");
  };
  EXPECT_ERROR(RunProcess({Shell(), "-c", script}, {.on_tick = stop}), ExitCode::kNumeric, "stop");
  WaitForDeath(ReadPid(dir / "pid"));
}

// Runs `body` in a child of the test; returns its exit code, or 128 + the signal that ended it. after_start
// runs in the parent with the child's pid.
int InChild(const std::function<void()>& body, const std::function<void(pid_t)>& after_start) {
  const pid_t child = fork();
  if (child == 0) {
    io::InstallInterruptHandlers();
    try {
      body();
    } catch (const io::Interrupted& interrupted) {
      _exit(100 + interrupted.signal());
    }
    _exit(0);
  }
  after_start(child);
  int status = 0;
  waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

TEST(Process, InterruptReachesTheChildAndIsThrown) {
  for (const int number : {SIGINT, SIGTERM}) {
    const TempDir dir;
    const std::string name = number == SIGINT ? "INT" : "TERM";
    const std::string script = "trap 'echo " + name + " > " + (dir / "got").string() + "; exit 1' " + name +
                               "; echo $$ > " + (dir / "pid").string() + "; while :; do sleep 0.02; done";
    const int result = InChild(
        [&] {
          RunProcess({Shell(), "-c", script}, {});
        },
        [&](pid_t child) {
          ReadPid(dir / "pid");
          kill(child, number);
        });
    EXPECT_EQ(result, 100 + number);
    EXPECT_EQ(ReadText(dir / "got"), name + "\n");
    WaitForDeath(ReadPid(dir / "pid"));
  }
}

TEST(Process, ChildDiesWithAKilledParentAndSecondInterruptEndsAtOnce) {
  for (const bool twice : {false, true}) {
    const TempDir dir;
    const std::string script = "trap '' INT; echo $$ > " + (dir / "pid").string() + "; exec sleep 3600";
    const int result = InChild(
        [&] {
          RunProcess({Shell(), "-c", script}, {.grace_s = 3600});
        },
        [&](pid_t child) {
          ReadPid(dir / "pid");
          kill(child, twice ? SIGINT : SIGKILL);
          if (!twice) return;
          WaitUntil([&] { return !IsPending(child, SIGINT); });  // two that are pending count as one
          kill(child, SIGINT);
        });
    EXPECT_EQ(result, 128 + (twice ? SIGINT : SIGKILL));
    WaitForDeath(ReadPid(dir / "pid"));
  }
}

TEST(Process, LogTailKeepsTheLastLinesShort) {
  const TempDir dir;
  WriteText(dir / "log", "one\ntwo\n" + std::string(5000, 'x') + "\nlast");
  const std::string tail = io::LogTail(dir / "log", 3);
  EXPECT_TRUE(tail.starts_with("two\nxxx"));
  EXPECT_TRUE(tail.ends_with("x\nlast\n"));
  EXPECT_LT(tail.size(), 400u);
  EXPECT_EQ(io::LogTail(dir / "none", 3), "");
}

TEST(Process, OutputIsAllThatIsPrintedHoweverItEnds) {
  EXPECT_EQ(io::OutputOf({"/bin/sh", "-c", "echo a; echo b >&2; exit 3"}, 10), "a\nb\n");
  EXPECT_EQ(io::OutputOf({"/bin/sh", "-c", "echo a; exec sleep 60"}, 0.3), "a\n");
}

}  // namespace
