// A large capture is mapped in overlapping blocks: what incremental mapping takes grows faster than the
// number of pictures, because it adjusts all that is there again and again, and blocks are mapped side by
// side.
#pragma once

#include <vector>

namespace sfm {

// Two pictures with verified matches.
struct PictureLink {
  int a = 0, b = 0;
  double weight = 0;  // number of matches
};

struct BlockOptions {
  int pictures = 75;     // at most, before neighbours are added
  double overlap = 0.3;  // pictures of neighbouring blocks that are added, as a share of its own
};

// Parts of the pictures 0 to n - 1, each in increasing order. Every connected component is cut in two where
// the normalised cut is smallest (Shi and Malik, "Normalized cuts and image segmentation", PAMI 2000), until
// no part has more pictures than asked for; then each part gets the pictures of others that have most matches
// with it. Pictures without any link are in no block.
std::vector<std::vector<int>> OverlappingBlocks(int n,
                                                const std::vector<PictureLink>& links,
                                                const BlockOptions& options);

}  // namespace sfm
