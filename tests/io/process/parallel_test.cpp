// Every turn is taken once, and what a turn throws reaches the caller.
#include "io/process/parallel.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace {

TEST(ParallelFor, TakesEveryTurnOnce) {
  for (const int threads : {1, 3}) {
    std::vector<int> turns(100);
    io::ParallelFor(turns.size(), threads, [&](std::size_t i) { ++turns[i]; });
    EXPECT_EQ(turns, std::vector<int>(100, 1)) << threads;
  }
  io::ParallelFor(0, 3, [](std::size_t) { ADD_FAILURE(); });
}

TEST(ParallelFor, StopsAtTheFirstException) {
  std::size_t turns = 0;
  const auto work = [&](std::size_t i) {
    ++turns;
    if (i == 5) throw std::invalid_argument("five");
  };
  EXPECT_THROW(io::ParallelFor(100, 1, work), std::invalid_argument);
  EXPECT_EQ(turns, 6u);
  EXPECT_THROW(io::ParallelFor(100, 3, [](std::size_t) { throw std::runtime_error("all"); }),
               std::runtime_error);
}

}  // namespace
