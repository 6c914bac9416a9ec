// Training of the `hash` field by several ranks: each computes some shards of a batch and sends what they
// leave for the optimiser to all others. Every rank then takes the same step, in the order of shards, so all
// hold the same field, bit for bit that of one rank. About 0.1 KB per sample that is kept and 41 KB per shard
// cross the network, whereas gradients of whole tables would be tens of megabytes.
#pragma once

#include <cstdint>
#include <vector>

#include "nerf/steps/hash_shard.h"

namespace nerf {

// Fills the shards that other ranks computed; those of this rank are [FirstTask of it, of the next one).
// Throws kLostRank when a rank's network or step is not the one that this rank holds: they would train
// different fields.
template <typename Real>
void ExchangeShards(const HashNetwork<Real>& network,
                    std::uint64_t step,
                    std::size_t n_levels,
                    std::vector<HashShard<Real>>* shards);

}  // namespace nerf
