#include "io/process/ranks.h"

#include <cstdint>
#include <utility>

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
  std::string mine;
  for (const std::size_t i : OwnTasks(results->size())) {
    const std::uint64_t length = (*results)[i].size();
    mine.append(reinterpret_cast<const char*>(&length), sizeof length) += (*results)[i];
  }
  const std::vector<std::string> all = ranks.AllGather(std::move(mine));
  std::vector<std::size_t> read(all.size(), 0);
  for (std::size_t i = 0; i < results->size(); ++i) {
    const std::string& theirs = all[i % all.size()];
    std::size_t& at = read[i % all.size()];
    std::uint64_t length = 0;
    theirs.copy(reinterpret_cast<char*>(&length), sizeof length, at);
    (*results)[i] = theirs.substr(at + sizeof length, length);
    at += sizeof length + length;
  }
}

JoinFunction& Join() {
  static JoinFunction join;
  return join;
}

}  // namespace io
