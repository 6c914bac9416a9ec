// A loop whose turns are spread over threads.
#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "io/interrupt.h"

namespace sfm {

// Calls work(i) for every i < n. No further turn begins after an interrupt or once a turn has thrown; the
// caller then gets io::Interrupted or the first exception.
template <typename Work>
void ParallelFor(std::size_t n, int threads, const Work& work) {
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr failure;
  {
    std::vector<std::jthread> workers;
    for (int t = 0; t < threads; ++t) {
      workers.emplace_back([&] {
        for (std::size_t i = next++; i < n && io::PendingInterrupt() == 0; i = next++) {
          try {
            work(i);
          } catch (...) {
            const std::lock_guard lock(mutex);
            if (!failure) failure = std::current_exception();
            next = n;
          }
        }
      });
    }
  }
  io::ThrowIfInterrupted();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace sfm
