#include "nerf/steps/shard_exchange.h"

#include <fmt/format.h>

#include <string>
#include <string_view>

#include "io/base/check.h"
#include "io/base/packed.h"
#include "io/process/ranks.h"

namespace nerf {
namespace {

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
void AddShard(const HashShard<Real>& shard, std::size_t n_levels, io::Packer* message) {
  const Samples& sorted = shard.samples.sorted;
  message->Add(sorted.x).Add(sorted.y).Add(sorted.z);
  message->Add(shard.samples.visited_cell).Add(shard.samples.visited_sigma);
  message->AddValues(shard.feature_gradients.data(), n_levels * shard.feature_gradient_stride);
  message->Add(shard.weight_gradients).Add(shard.camera_gradients.size());
  for (const Vector6d& gradient : shard.camera_gradients) message->AddValues(gradient.data(), 6);
  message->Add(shard.loss);
}

template <typename Real>
void TakeShard(std::size_t n_levels, io::Unpacker* message, HashShard<Real>* shard) {
  Samples& sorted = shard->samples.sorted;
  message->Take(&sorted.x), message->Take(&sorted.y), message->Take(&sorted.z);
  sorted.resize(sorted.x.size());
  message->Take(&shard->samples.visited_cell), message->Take(&shard->samples.visited_sigma);
  shard->feature_gradient_stride = sorted.x.size() * kernels::kFeatures;
  shard->feature_gradients.resize(n_levels * shard->feature_gradient_stride);
  message->TakeValues(shard->feature_gradients.data(), shard->feature_gradients.size());
  message->Take(&shard->weight_gradients);
  shard->camera_gradients.resize(message->Take<std::size_t>());
  for (Vector6d& gradient : shard->camera_gradients) message->TakeValues(gradient.data(), 6);
  message->Take(&shard->loss);
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
  io::Packer mine;
  mine.Reserve(length);
  mine.AddValues(state.data(), state.size());
  for (int s = first; s < last; ++s) AddShard((*shards)[static_cast<std::size_t>(s)], n_levels, &mine);
  const std::vector<std::string> all = ranks.AllGather(mine.Take());
  for (int r = 0; r < ranks.size(); ++r) {
    if (r == ranks.rank()) continue;
    const std::string_view bytes = all[static_cast<std::size_t>(r)];
    if (!bytes.starts_with(state)) {
      throw io::Error(
          io::ExitCode::kLostRank,
          fmt::format("rank {} holds another field than rank {} before step {}", r, ranks.rank(), step),
          "Start all ranks from one run folder, on processors and systems of one kind");
    }
    io::Unpacker parcel(bytes.substr(state.size()));
    for (int s = io::FirstTask(n, r, ranks.size()); s < io::FirstTask(n, r + 1, ranks.size()); ++s)
      TakeShard(n_levels, &parcel, &(*shards)[static_cast<std::size_t>(s)]);
    PIPELINE_CHECK(parcel.IsEmpty());
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
