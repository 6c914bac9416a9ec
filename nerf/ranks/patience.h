// A limit to waiting inside a library that cannot be asked to stop.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace nerf {

// Until it is destroyed, ends the process with one line and kLostRank after `limit`, and at a signal. For
// times when nothing of ours is at stake.
class Patience {
 public:
  Patience(int rank, std::chrono::seconds limit);
  ~Patience();
  // What the line will name.
  void WaitFor(const std::string& what);

 private:
  void Watch();

  const int rank_;
  const std::chrono::seconds limit_;
  std::mutex mutex_;
  std::condition_variable ended_;
  std::string what_;
  bool has_ended_ = false;
  std::thread watcher_;
};

}  // namespace nerf
