// How several processes become the ranks of one task. What joins them is registered by the programs that
// have it: it needs LibTorch (nerf/ranks), which others need not load.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "io/process/ranks.h"

namespace io {

struct Meeting {
  int rank = 0, size = 1;
  std::string address;  // of rank 0; traffic stays on the network that leads there
  std::uint16_t port = 0;
  bool has_store = false;  // who started the ranks keeps the store, and rank 0 need not
  // Names in the store begin with it: who does not know the secret of a run finds nothing there.
  std::string secret;
  std::chrono::seconds patience{300};  // until all ranks must be there
};

using JoinFunction = std::function<std::unique_ptr<Ranks>(const Meeting&)>;
// What this program joins with; empty: it cannot.
JoinFunction& Join();

}  // namespace io
