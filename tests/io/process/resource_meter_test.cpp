// io/process/resource_meter.h
#include "io/process/resource_meter.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <ctime>
#include <thread>
#include <vector>

#include "io/process/process.h"
#include "io/process/stopwatch.h"

namespace {

constexpr double kTick = 0.004;  // the kernel counts CPU time in ticks of at most 4 ms

// Processor time of this process.
double ClockSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// Whatever else the machine does: the figures lie between those of clocks started before and after the meter.
TEST(ResourceMeter, SleepingTakesWallTimeOnly) {
  const io::Stopwatch around;
  const double cpu_start_s = ClockSeconds();
  const io::ResourceMeter meter;
  const io::Stopwatch within;
  std::this_thread::sleep_for(std::chrono::milliseconds(120));
  const double slept_s = within.seconds();
  const io::ResourceUse use = meter.Use();
  EXPECT_GE(use.wall_s, slept_s);
  EXPECT_LE(use.wall_s, around.seconds());
  EXPECT_LE(use.cpu_s, ClockSeconds() - cpu_start_s + kTick);
  EXPECT_LT(use.cpu_s, use.wall_s);
}

TEST(ResourceMeter, WorkTakesCpuTime) {
  const io::ResourceMeter meter;
  const double start_s = ClockSeconds();
  while (ClockSeconds() - start_s < 5 * kTick) {
  }
  EXPECT_GE(meter.Use().cpu_s, 4 * kTick);
}

TEST(ResourceMeter, CountsChildrenThatEnded) {
  const auto shell = io::FindProgram("sh");
  ASSERT_TRUE(shell.has_value());
  const io::ResourceMeter meter;
  const io::ProcessReport report =
      io::RunProcess({shell->string(), "-c", "i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done"}, {});
  ASSERT_TRUE(report.Ok());
  const io::ResourceUse use = meter.Use();
  EXPECT_GT(report.cpu_s, 0.005);
  EXPECT_GE(use.cpu_s, report.cpu_s - kTick);
  EXPECT_GE(use.wall_s, report.wall_s);
}

TEST(ResourceMeter, ThePeakIsThatOfTheMeasuredWork) {
  constexpr std::size_t kBlock = std::size_t{64} << 20;
  std::size_t before = 0;
  {
    const io::ResourceMeter meter;
    before = meter.Use().peak_rss_bytes;
    std::vector<char> block(kBlock, 'x');
    EXPECT_EQ(block[kBlock / 2], 'x');
    EXPECT_GE(meter.Use().peak_rss_bytes, before + kBlock / 2);
  }
  EXPECT_GT(before, std::size_t{1} << 20);
  if (access("/proc/self/clear_refs", W_OK) != 0) GTEST_SKIP() << "the kernel does not reset the peak";
  // The block is free again and counts no longer.
  EXPECT_LT(io::ResourceMeter().Use().peak_rss_bytes, before + kBlock / 2);
}

}  // namespace
