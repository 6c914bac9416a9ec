// A fixed set of worker threads. Results never depend on their number: work is cut into tasks by its own
// size, and each task writes its own outputs.
#pragma once

#include <functional>
#include <memory>

namespace nerf {

class Workers {
 public:
  explicit Workers(int n_threads);
  ~Workers();
  int n_threads() const;

  // Calls task(i, thread) for every i in [0, n_tasks), in increasing order of start; returns when all are
  // done and rethrows the first exception. The calling thread works too.
  void Run(int n_tasks, const std::function<void(int i, int thread)>& task);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace nerf
