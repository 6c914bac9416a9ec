#include "nerf/steps/shard_exchange.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "io/base/check.h"
#include "io/base/hash.h"
#include "io/process/ranks.h"

namespace nerf {
namespace {

template <typename T>
void AppendValues(const T* values, std::size_t n, std::string* bytes) {
  static_assert(std::is_trivially_copyable_v<T>);
  bytes->append(reinterpret_cast<const char*>(values), n * sizeof(T));
}

template <typename T>
void Append(const T& value, std::string* bytes) {
  AppendValues(&value, 1, bytes);
}

template <typename Vector>
void AppendVector(const Vector& values, std::string* bytes) {
  Append(values.size(), bytes);
  AppendValues(values.data(), values.size(), bytes);
}

// Takes values from the front of a message, in the order in which they were appended.
class Message {
 public:
  explicit Message(std::string_view bytes) : bytes_(bytes) {}
  bool IsRead() const { return bytes_.empty(); }

  template <typename T>
  void TakeValues(T* values, std::size_t n) {
    PIPELINE_CHECK_LE(n, bytes_.size() / sizeof(T));
    std::copy_n(bytes_.data(), n * sizeof(T), reinterpret_cast<char*>(values));
    bytes_.remove_prefix(n * sizeof(T));
  }
  template <typename T>
  T Take() {
    T value;
    TakeValues(&value, 1);
    return value;
  }
  template <typename Vector>
  void TakeVector(Vector* values) {
    values->resize(Take<std::size_t>());
    TakeValues(values->data(), values->size());
  }

 private:
  std::string_view bytes_;
};

// About as long as the message of a shard.
template <typename Real>
std::size_t Length(const HashShard<Real>& shard, std::size_t n_levels) {
  constexpr std::size_t kMargin = 256;  // lengths and losses
  return sizeof(float) * (3 * shard.samples.sorted.x.size() + 2 * shard.samples.visited_cell.size() +
                          shard.weight_gradients.size()) +
         sizeof(Real) * n_levels * shard.feature_gradient_stride +
         sizeof(Vector6d) * shard.camera_gradients.size() + kMargin;
}

// Of the samples, what Scatter, VisitCells and TrainedCells::Mark read.
template <typename Real>
void AppendShard(const HashShard<Real>& shard, std::size_t n_levels, std::string* bytes) {
  const Samples& sorted = shard.samples.sorted;
  AppendVector(sorted.x, bytes);
  AppendValues(sorted.y.data(), sorted.y.size(), bytes);
  AppendValues(sorted.z.data(), sorted.z.size(), bytes);
  AppendVector(shard.samples.visited_cell, bytes);
  AppendValues(shard.samples.visited_sigma.data(), shard.samples.visited_sigma.size(), bytes);
  AppendValues(shard.feature_gradients.data(), n_levels * shard.feature_gradient_stride, bytes);
  AppendVector(shard.weight_gradients, bytes);
  Append(shard.camera_gradients.size(), bytes);
  for (const Vector6d& gradient : shard.camera_gradients) AppendValues(gradient.data(), 6, bytes);
  Append(shard.loss, bytes);
}

template <typename Real>
void TakeShard(std::size_t n_levels, Message* message, HashShard<Real>* shard) {
  Samples& sorted = shard->samples.sorted;
  message->TakeVector(&sorted.x);
  sorted.resize(sorted.x.size());
  message->TakeValues(sorted.y.data(), sorted.y.size());
  message->TakeValues(sorted.z.data(), sorted.z.size());
  message->TakeVector(&shard->samples.visited_cell);
  shard->samples.visited_sigma.resize(shard->samples.visited_cell.size());
  message->TakeValues(shard->samples.visited_sigma.data(), shard->samples.visited_sigma.size());
  shard->feature_gradient_stride = sorted.x.size() * kernels::kFeatures;
  shard->feature_gradients.resize(n_levels * shard->feature_gradient_stride);
  message->TakeValues(shard->feature_gradients.data(), shard->feature_gradients.size());
  message->TakeVector(&shard->weight_gradients);
  shard->camera_gradients.resize(message->Take<std::size_t>());
  for (Vector6d& gradient : shard->camera_gradients) message->TakeValues(gradient.data(), 6);
  shard->loss = message->Take<ShardLoss>();
}

}  // namespace

template <typename Real>
void ExchangeShards(const HashNetwork<Real>& network,
                    std::uint64_t step,
                    std::size_t n_levels,
                    std::vector<HashShard<Real>>* shards) {
  io::Ranks& ranks = io::AllRanks();
  const int n = static_cast<int>(shards->size());
  const std::string state = fmt::format("{} {}", step, network.Hash());
  std::size_t length = state.size();
  const int first = io::FirstTask(n, ranks.rank(), ranks.size()),
            last = io::FirstTask(n, ranks.rank() + 1, ranks.size());
  for (int s = first; s < last; ++s) length += Length((*shards)[static_cast<std::size_t>(s)], n_levels);
  std::string mine;
  mine.reserve(length);
  mine = state;
  for (int s = first; s < last; ++s) AppendShard((*shards)[static_cast<std::size_t>(s)], n_levels, &mine);
  const std::vector<std::string> all = ranks.AllGather(std::move(mine));
  for (int r = 0; r < ranks.size(); ++r) {
    if (r == ranks.rank()) continue;
    const std::string_view bytes = all[static_cast<std::size_t>(r)];
    if (!bytes.starts_with(state)) {
      throw io::Error(
          io::ExitCode::kLostRank,
          fmt::format("rank {} holds another field than rank {} before step {}", r, ranks.rank(), step),
          "Start all ranks from one run folder, on processors and systems of one kind");
    }
    Message parcel(bytes.substr(state.size()));
    for (int s = io::FirstTask(n, r, ranks.size()); s < io::FirstTask(n, r + 1, ranks.size()); ++s)
      TakeShard(n_levels, &parcel, &(*shards)[static_cast<std::size_t>(s)]);
    PIPELINE_CHECK(parcel.IsRead());
  }
}

template void ExchangeShards(const HashNetwork<float>&,
                             std::uint64_t,
                             std::size_t,
                             std::vector<HashShard<float>>*);
template void ExchangeShards(const HashNetwork<kernels::Bf16>&,
                             std::uint64_t,
                             std::size_t,
                             std::vector<HashShard<kernels::Bf16>>*);

}  // namespace nerf
