#include "io/process/ranks.h"

#include <utility>

#include "io/base/packed.h"
#include "io/process/meeting.h"

namespace io {
namespace {

class OneRank : public Ranks {
 public:
  int rank() const override { return 0; }
  int size() const override { return 1; }
  std::vector<std::string> AllGather(std::string bytes) override { return {std::move(bytes)}; }
  void Broadcast(std::string*) override {}
  void Leave() override {}
};

std::unique_ptr<Ranks>& Current() {
  static std::unique_ptr<Ranks> current = std::make_unique<OneRank>();
  return current;
}

}  // namespace

Ranks& AllRanks() { return *Current(); }

std::unique_ptr<Ranks> UseRanks(std::unique_ptr<Ranks> ranks) {
  std::swap(ranks, Current());
  return ranks;
}

std::vector<std::size_t> OwnTasks(std::size_t n) {
  const Ranks& ranks = AllRanks();
  std::vector<std::size_t> tasks;
  for (auto i = static_cast<std::size_t>(ranks.rank()); i < n; i += static_cast<std::size_t>(ranks.size()))
    tasks.push_back(i);
  return tasks;
}

void GatherTasks(std::vector<std::string>* results) {
  Ranks& ranks = AllRanks();
  if (!ranks.AreSeveral()) return;
  Packer mine;
  for (const std::size_t i : OwnTasks(results->size())) mine.Add((*results)[i]);
  const std::vector<std::string> all = ranks.AllGather(mine.Take());
  std::vector<Unpacker> of_ranks(all.begin(), all.end());
  for (std::size_t i = 0; i < results->size(); ++i) of_ranks[i % all.size()].Take(&(*results)[i]);
}

JoinFunction& Join() {
  static JoinFunction join;
  return join;
}

}  // namespace io
