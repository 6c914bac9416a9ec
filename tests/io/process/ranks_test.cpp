// Which tasks a rank computes, and where the results of others go.
#include "io/process/ranks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

namespace {

// A rank whose exchange is played: keeps what it gives, and gets what the others gave when they were played;
// its own where they were not.
class PlayedRank : public io::Ranks {
 public:
  PlayedRank(int rank, std::vector<std::string>* given) : rank_(rank), given_(*given) {}
  int rank() const override { return rank_; }
  int size() const override { return static_cast<int>(given_.size()); }
  std::vector<std::string> AllGather(std::string bytes) override {
    given_[static_cast<std::size_t>(rank_)] = bytes;
    std::vector<std::string> all = given_;
    std::replace(all.begin(), all.end(), std::string(), bytes);
    return all;
  }
  void Broadcast(std::string* bytes) override { *bytes = given_[0]; }
  void Leave() override {}

 private:
  const int rank_;
  std::vector<std::string>& given_;
};

// The results on the last of `size` ranks, played one after the other.
template <typename T, typename Work>
std::vector<T> OnLastOf(int size, std::size_t n, const Work& work) {
  std::vector<std::string> given(static_cast<std::size_t>(size));
  std::vector<T> results;
  for (int r = 0; r < size; ++r) {
    std::unique_ptr<io::Ranks> before = io::UseRanks(std::make_unique<PlayedRank>(r, &given));
    results.assign(n, T());
    for (const std::size_t i : io::OwnTasks(n)) results[i] = work(i);
    io::GatherTasks(&results);
    io::UseRanks(std::move(before));
  }
  return results;
}

TEST(RankTasks, OneComputesEverythingAndWaitsForNobody) {
  EXPECT_EQ(io::AllRanks().size(), 1);
  EXPECT_EQ(io::OwnTasks(3), (std::vector<std::size_t>{0, 1, 2}));
  std::vector<double> results = {1, 2, 3};
  io::GatherTasks(&results);
  EXPECT_EQ(results, (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(io::FromFirst(7), 7);
}

TEST(RankTasks, EachIsComputedByOneRankAndKnownToAll) {
  for (const int size : {2, 3, 5}) {
    EXPECT_EQ(OnLastOf<double>(size, 7, [](std::size_t i) { return 1.5 * static_cast<double>(i); }),
              (std::vector<double>{0, 1.5, 3, 4.5, 6, 7.5, 9}));
    EXPECT_EQ(OnLastOf<std::string>(size, 4, [](std::size_t i) { return std::string(3 * i, 'x'); }),
              (std::vector<std::string>{"", "xxx", "xxxxxx", "xxxxxxxxx"}));
    for (int n = 0; n < 40; ++n) {
      EXPECT_EQ(io::FirstTask(n, 0, size), 0);
      EXPECT_EQ(io::FirstTask(n, size, size), n);
    }
  }
}

TEST(RankTasks, TheFirstDecides) {
  const int told = 42;
  std::vector<std::string> given = {std::string(reinterpret_cast<const char*>(&told), sizeof told), ""};
  auto before = io::UseRanks(std::make_unique<PlayedRank>(1, &given));
  EXPECT_EQ(io::FromFirst(7), 42);
  io::UseRanks(std::move(before));
}

}  // namespace
