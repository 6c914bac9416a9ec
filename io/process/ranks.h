// The processes that do one task together, on one machine or several: rank 0 to size - 1, usually only one.
// Each computes its part and gives it to all others, so that all go on with the same. All ranks make the same
// calls in the same order.
#pragma once

#include <memory>
#include <string>
#include <type_traits>
#include <vector>

namespace io {

class Ranks {
 public:
  virtual ~Ranks() = default;
  virtual int rank() const = 0;
  virtual int size() const = 0;
  bool IsFirst() const { return rank() == 0; }
  bool AreSeveral() const { return size() > 1; }

  // The bytes of every rank, in the order of ranks. When a rank is lost, throws Interrupted (interrupt.h).
  virtual std::vector<std::string> AllGather(std::string bytes) = 0;
  // Replaces `bytes` by those of rank 0.
  virtual void Broadcast(std::string* bytes) = 0;
  // Tells the others that this rank has done its part; who goes without counts as failed.
  virtual void Leave() = 0;
};

// Those of this process: itself alone until UseRanks was called.
Ranks& AllRanks();
// Returns the ranks before.
std::unique_ptr<Ranks> UseRanks(std::unique_ptr<Ranks> ranks);

// What rank 0 has decided.
template <typename T>
T FromFirst(const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (!AllRanks().AreSeveral()) return value;
  std::string bytes(reinterpret_cast<const char*>(&value), sizeof value);
  AllRanks().Broadcast(&bytes);
  T first = value;
  bytes.copy(reinterpret_cast<char*>(&first), sizeof first);
  return first;
}

// First of the tasks [0, n) that a rank computes: its own are those before the first of the next rank.
inline int FirstTask(int n, int rank, int size) {
  return static_cast<int>(static_cast<long long>(n) * rank / size);
}

// Of n tasks whose neighbours cost about the same, those of this rank: every size-th.
std::vector<std::size_t> OwnTasks(std::size_t n);
// Fills the results of the tasks of other ranks, when those of this one are there. Also a barrier.
void GatherTasks(std::vector<std::string>* results);

template <typename T>
void GatherTasks(std::vector<T>* results) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (!AllRanks().AreSeveral()) return;
  std::vector<std::string> bytes;
  for (const T& result : *results) bytes.emplace_back(reinterpret_cast<const char*>(&result), sizeof(T));
  GatherTasks(&bytes);
  for (std::size_t i = 0; i < bytes.size(); ++i)
    bytes[i].copy(reinterpret_cast<char*>(&(*results)[i]), sizeof(T));
}

}  // namespace io
