// What two ranks send each other, as it lies in memory: all ranks run the same program.
#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace nerf {

enum class State : std::int32_t { kWorking, kLeft, kFailed };

// What ranks tell one another all the time.
struct Beat {
  State state = State::kWorking;
  std::int32_t lost = -1;  // the rank that it failed for
};

// How a message begins: few are longer, and each costs a round trip.
constexpr std::size_t kHeadBytes = 120;
struct Head {
  std::uint64_t length = 0;
  std::array<char, kHeadBytes> bytes{};
};

inline Head HeadOf(const std::string& bytes) {
  Head head{.length = bytes.size(), .bytes = {}};
  bytes.copy(head.bytes.data(), kHeadBytes);
  return head;
}

}  // namespace nerf
