#include "io/process/interrupt.h"

#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <mutex>
#include <string_view>

namespace io {
namespace {

constexpr unsigned kPromptStop_s = 2;  // after longer, people press Ctrl-C again

std::atomic<int> pending_signal = 0;  // lock-free, hence safe in a handler, as is the next
std::atomic<int> prompt_stops = 0;
std::mutex reason_mutex;
std::optional<Error> stop_reason;

void OnSignal(int number) {
  if (pending_signal.exchange(number) != 0) {
    signal(number, SIG_DFL);
    raise(number);
  }
  if (prompt_stops > 0) alarm(kPromptStop_s);
}

void OnAlarm(int) {
  constexpr std::string_view kWords = "stopped by a signal; the same command continues\n";
  [[maybe_unused]] const ssize_t n = write(STDERR_FILENO, kWords.data(), kWords.size());
  _exit(128 + pending_signal);
}

}  // namespace

void InstallInterruptHandlers() {
  struct sigaction action = {};
  action.sa_handler = OnSignal;
  action.sa_flags = SA_RESTART;  // libraries need not expect interrupted system calls; our loops poll
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  action.sa_handler = OnAlarm;
  sigaction(SIGALRM, &action, nullptr);
  // A closed pipe and a file at its size limit are reported as failed writes, not by ending the process.
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);
}

int PendingInterrupt() { return pending_signal.load(); }

void ThrowIfInterrupted() {
  if (const int number = PendingInterrupt()) throw Interrupted(number);
}

PromptStop::PromptStop() {
  ++prompt_stops;
  if (PendingInterrupt() != 0) alarm(kPromptStop_s);  // it came before
}

PromptStop::~PromptStop() {
  if (--prompt_stops == 0) alarm(0);
}

void StopBecause(const Error& reason) {
  {
    const std::lock_guard lock(reason_mutex);
    if (!stop_reason) stop_reason = reason;
  }
  int none = 0;
  pending_signal.compare_exchange_strong(none, SIGTERM);
}

std::optional<Error> StopReason() {
  const std::lock_guard lock(reason_mutex);
  return stop_reason;
}

}  // namespace io
