#include "nerf/ranks/patience.h"

#include <fmt/format.h>
#include <unistd.h>

#include "io/base/error.h"
#include "io/base/quoting.h"
#include "io/process/interrupt.h"

namespace nerf {
namespace {

constexpr std::chrono::milliseconds kLook(100);

[[noreturn]] void EndProcess(const std::string& line, int code) {
  const std::string text = "pipeline: " + io::Printable(line) + "\n";
  [[maybe_unused]] const ssize_t n = write(STDERR_FILENO, text.data(), text.size());
  _exit(code);
}

}  // namespace

Patience::Patience(int rank, std::chrono::seconds limit)
    : rank_(rank), limit_(limit), watcher_([this] { Watch(); }) {}

Patience::~Patience() {
  {
    const std::lock_guard lock(mutex_);
    has_ended_ = true;
  }
  ended_.notify_all();
  watcher_.join();
}

void Patience::WaitFor(const std::string& what) {
  const std::lock_guard lock(mutex_);
  what_ = what;
}

void Patience::Watch() {
  const auto end = std::chrono::steady_clock::now() + limit_;
  std::unique_lock lock(mutex_);
  while (!ended_.wait_for(lock, kLook, [&] { return has_ended_; })) {
    if (const int signal = io::PendingInterrupt())
      EndProcess(fmt::format("rank {} stopped by signal {} while it waited for {}", rank_, signal, what_),
                 128 + signal);
    if (std::chrono::steady_clock::now() < end) continue;
    const int code = static_cast<int>(io::ExitCode::kLostRank);
    EndProcess(fmt::format("error E{}: rank {} waited {} s in vain for {}. Start all ranks with the same "
                           "MASTER_ADDR, MASTER_PORT, WORLD_SIZE and run folder",
                           code,
                           rank_,
                           limit_.count(),
                           what_),
               code);
  }
}

}  // namespace nerf
