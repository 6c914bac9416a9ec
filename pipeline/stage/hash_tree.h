// Content hashes of whole folders.
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace pipeline {

// Adds absolute path -> content hash of every regular file below `path`, or of the file itself, except below
// `skipped`. Throws kBadInput when one cannot be read.
void HashTree(const std::filesystem::path& path,
              const std::filesystem::path& skipped,
              std::map<std::string, std::string>* hashes);

}  // namespace pipeline
