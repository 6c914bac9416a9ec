// Maps a large capture in overlapping blocks, side by side, and joins what they give.
#pragma once

#include <filesystem>
#include <vector>

#include "sfm/mapping/found_model.h"
#include "sfm/mapping/mapping_attempt.h"

namespace sfm {

// attempt: has views and verified pairs, gets the numbers of blocks. The first model has the pictures of all
// blocks that could be joined: its cameras were moved together, adjusted by options.adjust_joined, and its
// points triangulated anew, which makes one track of those that ended at the border of a block. COLMAP then
// adds the pictures that no block could place. The models of blocks that could not be joined follow.
std::vector<FoundModel> MapInBlocks(Colmap* colmap,
                                    const ModelReader& reader,
                                    const std::filesystem::path& images_folder,
                                    const MappingOptions& options,
                                    MappingAttempt* attempt);

}  // namespace sfm
