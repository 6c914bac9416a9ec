#include "io/process/parallel.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <fstream>
#include <mutex>
#include <thread>
#include <vector>

#include "io/process/interrupt.h"

namespace io {

struct Workers::State {
  std::mutex mutex;
  std::condition_variable start, done;
  std::vector<std::thread> threads;
  const std::function<void(int, int)>* task = nullptr;
  int n_tasks = 0, running = 0;
  std::atomic<int> next = 0;
  long generation = 0;
  bool stop = false;
  std::exception_ptr error;

  // Here and not in ~Workers, which is not called where one of the threads cannot start.
  ~State() {
    {
      const std::lock_guard lock(mutex);
      stop = true;
    }
    start.notify_all();
    for (std::thread& thread : threads) thread.join();
  }

  void Work(int thread) {
    try {
      for (int i = next++; i < n_tasks; i = next++) (*task)(i, thread);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!error) error = std::current_exception();
      next = n_tasks;
    }
  }

  void Loop(int thread) {
    long seen = 0;
    for (;;) {
      std::unique_lock lock(mutex);
      start.wait(lock, [&] { return stop || generation != seen; });
      if (stop) return;
      seen = generation;
      lock.unlock();
      Work(thread);
      lock.lock();
      if (--running == 0) done.notify_one();
    }
  }
};

Workers::Workers(int n_threads) : state_(std::make_unique<State>()) {
  for (int i = 1; i < n_threads; ++i)
    state_->threads.emplace_back([state = state_.get(), i] { state->Loop(i); });
}

Workers::~Workers() = default;

int Workers::n_threads() const { return static_cast<int>(state_->threads.size()) + 1; }

void Workers::Run(int n_tasks, const std::function<void(int, int)>& task) {
  {
    const std::lock_guard lock(state_->mutex);
    state_->task = &task;
    state_->n_tasks = n_tasks;
    state_->next = 0;
    state_->error = nullptr;
    state_->running = static_cast<int>(state_->threads.size());
    ++state_->generation;
  }
  state_->start.notify_all();
  state_->Work(0);
  std::unique_lock lock(state_->mutex);
  state_->done.wait(lock, [&] { return state_->running == 0; });
  if (state_->error) std::rethrow_exception(state_->error);
}

int AvailableCores() {
  int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::ifstream cpu_max("/sys/fs/cgroup/cpu.max");  // "quota period" in microseconds, or "max period"
  double quota = 0, period = 0;
  if (cpu_max >> quota >> period && quota > 0 && period > 0)
    cores = std::clamp(static_cast<int>(std::ceil(quota / period)), 1, cores);
  return cores;
}

void ParallelFor(std::size_t n, int threads, const std::function<void(std::size_t)>& work) {
  const int n_tasks = static_cast<int>(n);
  Workers(std::min(threads, n_tasks)).Run(n_tasks, [&](int i, int) {
    if (PendingInterrupt() == 0) work(static_cast<std::size_t>(i));
  });
  ThrowIfInterrupted();
}

void GiveWay() {
  constexpr int kNice = 10;  // each step is a factor of 1.25
  const auto thread = static_cast<id_t>(gettid());
  setpriority(PRIO_PROCESS, thread, getpriority(PRIO_PROCESS, thread) + kNice);
}

}  // namespace io
