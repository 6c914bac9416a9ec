// A budget refuses with its figures and counts what fits; a limit holds, also for the programs that are
// started.
#include "io/base/memory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <vector>

#include "io/base/error.h"
#include "io/process/process.h"
#include "tests/support/files/temp_dir.h"

namespace {

using io::MemoryBudget;

constexpr std::size_t kMib = std::size_t{1} << 20;

TEST(MemoryBudget, RefusesWithWhatIsNeededAndWhatIsThere) {
  const MemoryBudget budget(io::HeldMemoryBytes() + 300 * kMib);
  budget.Require(200 * kMib, "a small thing");
  EXPECT_ERROR(budget.Require(2000 * kMib, "a large thing"),
               io::ExitCode::kNoResources,
               "a large thing needs about 2.");
  EXPECT_ERROR(budget.Require(SIZE_MAX, "everything"), io::ExitCode::kNoResources, "--memory");
  MemoryBudget().Require(SIZE_MAX, "without bounds");
}

TEST(MemoryBudget, CountsWhatFitsAtOnce) {
  const MemoryBudget budget(io::HeldMemoryBytes() + 500 * kMib);
  EXPECT_EQ(budget.Fits(8, 100 * kMib), 4);
  EXPECT_EQ(budget.Fits(3, 100 * kMib), 3);
  EXPECT_EQ(budget.Fits(8, 100 * kMib, 200 * kMib), 2);
  EXPECT_EQ(budget.AtOnce(8, 100 * kMib, 0, "work"), 4);
  EXPECT_EQ(budget.Fits(8, 5000 * kMib), 1);  // what decides whether that begins is Require
  EXPECT_ERROR(budget.AtOnce(8, 5000 * kMib, 0, "work"), io::ExitCode::kNoResources, "work needs about");
  EXPECT_EQ(MemoryBudget().Fits(8, 100 * kMib), 8);
}

TEST(MemoryText, IsShort) {
  EXPECT_EQ(io::MemoryText(300 * kMib), "300 MiB");
  EXPECT_EQ(io::MemoryText(1536 * kMib), "1.5 GiB");
}

TEST(FreeMemory, IsSomethingAndNotAll) {
  EXPECT_GT(io::FreeMemoryBytes(), 16 * kMib);
  EXPECT_LT(io::FreeMemoryBytes(), std::size_t{1} << 50);
}

// Ends with 0 when memory within the limit is to be had and more is not.
[[noreturn]] void TakeMemoryUnderALimit() {
  io::LimitMemory(MemoryBudget(io::HeldMemoryBytes() + 200 * kMib), 1);
  const auto take = [](std::size_t bytes) {
    try {
      return std::vector<char>(bytes, 1).back() == 1;
    } catch (const std::bad_alloc&) {
      return false;
    }
  };
  std::_Exit(take(100 * kMib) && !take(400 * kMib) ? 0 : 1);
}

TEST(LimitMemory, LetsTheBudgetBeUsedAndNoMore) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers map more than any limit";
#endif
  EXPECT_EXIT(TakeMemoryUnderALimit(), testing::ExitedWithCode(0), "");
}

// Ends with 0 when a program that takes 300 MB runs freely and fails under the limit.
[[noreturn]] void StartAHogUnderALimit(const std::filesystem::path& log) {
  const std::string hog = "x=$(head -c 300000000 /dev/zero | tr '\\0' a); echo ${#x}";
  const std::vector<std::string> argv = {io::FindProgram("sh").value().string(), "-c", hog};
  const bool ran = io::RunProcess(argv, {.log_path = log}).Ok();
  io::LimitMemory(MemoryBudget(io::HeldMemoryBytes() + 100 * kMib), 1);
  const bool ran_again = io::RunProcess(argv, {.log_path = log}).Ok();
  std::_Exit(ran && !ran_again && io::MemoryLeftBytes() < 150 * kMib ? 0 : 1);
}

TEST(LimitMemory, HoldsForProgramsThatAreStarted) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers map more than any limit";
#endif
  const TempDir dir;
  EXPECT_EXIT(StartAHogUnderALimit(dir / "log"), testing::ExitedWithCode(0), "");
}

}  // namespace
