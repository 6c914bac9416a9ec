// Every turn is taken once, and what a turn throws reaches the caller.
#include "io/process/parallel.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>
#include <thread>

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

TEST(GiveWay, IsOfTheThreadAndThoseThatItStarts) {
  const auto nice = [] { return getpriority(PRIO_PROCESS, static_cast<id_t>(gettid())); };
  const int before = nice();
  std::vector<int> after(2, before);
  std::thread([&] {
    io::GiveWay();
    after[0] = nice();
    std::thread([&] { after[1] = nice(); }).join();
  }).join();
  EXPECT_EQ(after[0], std::min(before + 10, 19));
  EXPECT_EQ(after[1], after[0]);
  EXPECT_EQ(nice(), before);
}

}  // namespace
