// Things that stand still in the picture while the subject moves: the background of a turntable, a watermark,
// a finger on the lens.
#pragma once

#include <cstddef>
#include <vector>

#include "sfm/features/matching.h"

namespace sfm {

struct StationaryShare {
  int pairs = 0;            // in which at least 15 matches move
  int split_pairs = 0;      // in which, beside them, at least 15 matches and a fifth of all stand still
  std::size_t removed = 0;  // matches
};

// A camera that moves leaves nothing in its place, so in a static world hardly any pair is split. Where at
// least half of the pairs are, two motions are mixed, and every match that stays within 4 px is removed
// (COLMAP's filter_stationary_matches); otherwise nothing is.
StationaryShare RemoveStationaryMatches(const std::vector<Features>& features,
                                        std::vector<PairMatches>* matches);

}  // namespace sfm
