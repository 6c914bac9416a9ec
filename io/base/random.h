// Counter-based random numbers: a value is a hash of (seed, stream, index), so the same seed gives the same
// numbers for any number of threads and after a resume. The mixer is SplitMix64's [Steele et al. 2014].
#pragma once

#include <cstdint>

namespace io {

inline std::uint64_t Mix(std::uint64_t z) {
  z += 0x9e3779b97f4a7c15ull;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

// What a stream of numbers is used for; each purpose draws from its own.
enum class Stream : std::uint64_t {
  kInit = 1,
  kRay,
  kProbe,
  kMonitor,
  kJitter,
  kSplat,
  kSplatView,
  kSplatBackground,
  kAlignment
};

class Random {
 public:
  Random(std::uint64_t seed, Stream stream, std::uint64_t step, std::uint64_t index)
      : state_(Mix(Mix(Mix(seed) ^ static_cast<std::uint64_t>(stream)) ^ step) +
               0x632be59bd9b4e019ull * index) {}

  std::uint64_t Bits() { return Mix(state_++); }
  // Uniform in [0, 1) with 24 bits, exact in float.
  float Uniform() { return static_cast<float>(Bits() >> 40) * 0x1p-24f; }
  // Uniform in [0, n); the bias of the multiply-shift is below n / 2^32.
  std::uint32_t Below(std::uint32_t n) { return static_cast<std::uint32_t>((Bits() >> 32) * n >> 32); }

 private:
  std::uint64_t state_;
};

}  // namespace io
