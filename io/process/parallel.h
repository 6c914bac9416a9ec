// The one parallel loop. Results never depend on the number of threads: work is cut into tasks by its own
// size, and each task writes its own outputs.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace io {

// A fixed set of threads, for work that comes in many small loops.
class Workers {
 public:
  explicit Workers(int n_threads);
  ~Workers();
  int n_threads() const;

  // Calls task(i, thread) for every i in [0, n_tasks), in increasing order of start, and returns when all are
  // done. No task begins once one has thrown; the first exception is rethrown. The calling thread works too.
  void Run(int n_tasks, const std::function<void(int i, int thread)>& task);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Cores this process may use: its affinity, and the CPU quota of its container.
int AvailableCores();

// One loop: calls work(i) for every i < n on `threads` threads. No further turn begins after an interrupt or
// once a turn has thrown; the caller then gets Interrupted or the first exception.
void ParallelFor(std::size_t n, int threads, const std::function<void(std::size_t)>& work);

// From now on this thread, and those that it starts, get the processor when others of this session leave some
// of it: a tenth of what each of these gets. There is no way back without privileges.
void GiveWay();

}  // namespace io
