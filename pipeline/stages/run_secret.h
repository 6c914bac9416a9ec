// What only the ranks of a run know: they read it from their run folder, where rank 0 leaves it.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>

namespace pipeline {

// The text of <out>/.ranks.secret, readable by its owner alone. Rank 0 makes it where it is missing; others
// wait for it. Throws kLostRank when it does not appear, kNoResources when it cannot be written.
std::string RunSecret(const std::filesystem::path& out, bool is_first, std::chrono::seconds patience);

}  // namespace pipeline
