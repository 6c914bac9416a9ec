// A signal ends what no call can interrupt within seconds, and leaves alone what reacts to it.
#include "io/process/interrupt.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <cstdlib>

namespace {

// Longer than what a prompt stop waits for.
void IgnoreForAWhile() {
  for (int i = 0; i < 30; ++i) usleep(100000);
}

TEST(PromptStop, EndsWhatDoesNotReactWithTheCodeOfACleanStop) {
  const auto hang = [] {
    io::InstallInterruptHandlers();
    const io::PromptStop stop;
    raise(SIGINT);
    IgnoreForAWhile();
    std::exit(1);
  };
  EXPECT_EXIT(hang(), testing::ExitedWithCode(128 + SIGINT), "stopped by a signal");
}

TEST(PromptStop, CountsASignalThatCameBefore) {
  const auto hang = [] {
    io::InstallInterruptHandlers();
    raise(SIGTERM);
    const io::PromptStop stop;
    IgnoreForAWhile();
    std::exit(1);
  };
  EXPECT_EXIT(hang(), testing::ExitedWithCode(128 + SIGTERM), "stopped by a signal");
}

TEST(PromptStop, LeavesAloneWhatGoesOnToACleanStop) {
  const auto stop_cleanly = [] {
    io::InstallInterruptHandlers();
    {
      const io::PromptStop stop;
      raise(SIGINT);
    }
    IgnoreForAWhile();
    std::exit(io::PendingInterrupt() == SIGINT ? 0 : 1);
  };
  EXPECT_EXIT(stop_cleanly(), testing::ExitedWithCode(0), "");
}

}  // namespace
