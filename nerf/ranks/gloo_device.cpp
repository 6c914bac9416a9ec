#include "nerf/ranks/gloo_device.h"

#include <ATen/core/ivalue.h>  // first: clang cannot compile the others as C++20 while IValue is incomplete
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>

#include <future>

namespace nerf {
namespace {

constexpr int kNiceness = 10;

}  // namespace

// The device's thread spins while another one holds the lock of a connection, and can keep that one from the
// processor meanwhile, up to a tick of 4 ms: as a batch thread it waits until the other one sleeps. Threads
// inherit niceness and policy.
std::shared_ptr<gloo::transport::Device> MakeGlooDevice(const std::string& address) {
  return std::async(std::launch::async,
                    [&] {
                      setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceness);
                      const sched_param none = {};
                      sched_setscheduler(0, SCHED_BATCH, &none);  // of this thread
                      return c10d::ProcessGroupGloo::createDeviceForHostname(address);
                    })
      .get();
}

}  // namespace nerf
