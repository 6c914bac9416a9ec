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
  double share = 0;         // of all matches that were removed
  // Where the removed ones lie: cells of a grid of 8 x 8 over the features of all pictures in which at least
  // 15 matches and a fifth of all stand still, over all 64.
  double covered = 0;

  // A background stands behind most of the picture; a watermark or a finger covers a corner of it.
  bool IsBackground() const { return removed > 0 && covered >= 0.25; }
};

// A camera that moves leaves nothing in its place, so in a static world hardly any pair is split. Where at
// least half of the pairs are, two motions are mixed, and every match that stays within 4 px is removed
// (COLMAP's filter_stationary_matches); otherwise nothing is.
StationaryShare RemoveStationaryMatches(const std::vector<Features>& features,
                                        std::vector<PairMatches>* matches);

// Removes every match that stays within 4 px; their number.
std::size_t DropStationaryMatches(const std::vector<Features>& features, std::vector<PairMatches>* matches);

}  // namespace sfm
