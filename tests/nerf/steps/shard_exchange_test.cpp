// Ranks that hold different fields do not train on.
#include "nerf/steps/shard_exchange.h"

#include <gtest/gtest.h>

#include <memory>

#include "io/base/error.h"
#include "io/process/ranks.h"
#include "tests/support/files/temp_dir.h"

namespace {

using Shards = std::vector<nerf::HashShard<float>>;

// Rank 0 of two when the other one sends what was said.
class SpokenTo : public io::Ranks {
 public:
  explicit SpokenTo(const std::string& said) : said_(said) {}
  int rank() const override { return 0; }
  int size() const override { return 2; }
  std::vector<std::string> AllGather(std::string mine) override {
    said_ = said_.empty() ? mine : said_;
    return {mine, said_};
  }
  void Broadcast(std::string*) override {}
  void Leave() override {}

 private:
  std::string said_;  // empty: the same
};

void Exchange(const std::string& said) {
  const nerf::HashNetwork<float> network(1);
  Shards shards(2);
  std::unique_ptr<io::Ranks> before = io::UseRanks(std::make_unique<SpokenTo>(said));
  try {
    nerf::ExchangeShards(network, 12, 1, &shards);
  } catch (...) {
    io::UseRanks(std::move(before));
    throw;
  }
  io::UseRanks(std::move(before));
}

TEST(ShardExchange, ARankWithAnotherFieldOrStepIsNamed) {
  const std::string field = nerf::HashNetwork<float>(2).Hash();
  EXPECT_NO_THROW(Exchange(""));
  for (const std::string& said : {"12 " + field, std::string("13 "), std::string("1")}) {
    EXPECT_ERROR(
        Exchange(said), io::ExitCode::kLostRank, "rank 1 holds another field than rank 0 before step 12");
  }
}

}  // namespace
