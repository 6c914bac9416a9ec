// Random numbers for generated captures that are the same with every standard library: std::mt19937_64 is
// specified to the bit, the distributions of <random> are not.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

namespace sfm {

class Random {
 public:
  // Streams of one seed are independent of each other.
  Random(std::uint64_t seed, std::uint64_t stream) {
    std::seed_seq sequence{seed >> 32, seed & 0xffffffff, stream >> 32, stream & 0xffffffff};
    engine_.seed(sequence);
  }

  // In [0, 1), in steps of 2^-53.
  double Uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }

  // Mean 0, standard deviation 1 (Box and Muller 1958). 1 - Uniform() is never 0.
  double Normal() {
    const double radius = std::sqrt(-2 * std::log(1 - Uniform()));
    return radius * std::cos(2 * std::numbers::pi * Uniform());
  }

  // Fisher and Yates; the modulo bias is below 2^-32 for any list that fits in memory.
  template <typename T>
  void Shuffle(std::vector<T>* values) {
    for (std::size_t i = values->size(); i > 1; --i) std::swap((*values)[i - 1], (*values)[engine_() % i]);
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace sfm
