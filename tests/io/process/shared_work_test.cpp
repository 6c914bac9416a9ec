// Work that rank 0 shares out and the other computes when it is told of it.
#include "io/process/shared_work.h"

#include <gmock/gmock.h>

#include "io/base/error.h"
#include "tests/support/programs/forked_ranks.h"

namespace {

using testing::ElementsAre;
using Tasks = std::vector<std::size_t>;

io::TaskResults Name(const std::string& who, const Tasks& tasks) {
  io::TaskResults results;
  for (const std::size_t i : tasks) results.push_back(who + std::to_string(i));
  return results;
}
io::TaskResults Mine(const Tasks& tasks) { return Name("mine", tasks); }
io::TaskResults FailFor(const std::string& what, const Tasks&) {
  throw io::Error(io::ExitCode::kNoResources, what + " is full", "Free some");
}

TEST(SharedWork, OneRankDoesItAllAndTellsNobody) {
  const io::HelpOfOthers help;
  const auto tell = []() -> std::string { throw io::Error(io::ExitCode::kInternal, "told"); };
  EXPECT_THAT(io::ShareOut("name", 2, tell, Mine), ElementsAre("mine0", "mine1"));
}

TEST(SharedWork, EachRankComputesItsTasksFromWhatIsTold) {
  io::TaskResults first, second;
  const auto lead = [&] {
    const io::HelpOfOthers help;
    first = io::ShareOut(
        "size", 3, [] { return std::string(1 << 20, '\0'); }, Mine);
    second = io::ShareOut(
        "name", 5, [&] { return first[1] + "!"; }, Mine);
  };
  const io::ToldWorks works = {{"size",
                                [](const std::string& told, const Tasks& tasks) {
                                  return io::TaskResults(tasks.size(), std::to_string(told.size()));
                                }},
                               {"name", Name}};
  EXPECT_EQ(OnTwoRanks(lead, [&] { io::Help(works); }), 0);
  EXPECT_THAT(first, ElementsAre("mine0", "1048576", "mine2"));
  EXPECT_THAT(second, ElementsAre("mine0", "1048576!1", "mine2", "1048576!3", "mine4"));
}

// What rank 0 says when the work, told as "the disk", is done like this. The other rank fails as well.
std::string FailureWith(const io::OwnWork& own, const io::ToldWork& told) {
  std::string said;
  const auto lead = [&] {
    const io::HelpOfOthers help;
    try {
      io::ShareOut(
          "work", 2, [] { return std::string("the disk"); }, own);
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), io::ExitCode::kNoResources);
      said = error.what();
    }
  };
  EXPECT_EQ(OnTwoRanks(lead, [&] { io::Help({{"work", told}}); }), 1);
  return said;
}

TEST(SharedWork, AFailureEndsItOnAllRanksWithItsCode) {
  EXPECT_EQ(FailureWith(Mine, FailFor), "rank 1: the disk is full. Free some");
  const auto fail = [](const Tasks& tasks) { return FailFor("memory", tasks); };
  EXPECT_EQ(FailureWith(fail, Name), "memory is full. Free some");
}

TEST(SharedWork, OthersAreDismissedWhenTheFirstGivesUpByItself) {
  const auto give_up = [] {
    const io::HelpOfOthers help;
    throw io::Error(io::ExitCode::kNotReconstructible, "no baseline");
  };
  EXPECT_EQ(OnTwoRanks([&] { EXPECT_THROW(give_up(), io::Error); }, [] { io::Help({}); }), 0);
}

}  // namespace
