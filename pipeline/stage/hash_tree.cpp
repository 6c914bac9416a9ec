#include "pipeline/stage/hash_tree.h"

#include "io/base/error.h"
#include "io/base/hash.h"

namespace pipeline {

namespace fs = std::filesystem;

void HashTree(const fs::path& path, const fs::path& skipped, std::map<std::string, std::string>* hashes) {
  const fs::path root = fs::absolute(path).lexically_normal();
  try {
    if (fs::is_regular_file(root)) (*hashes)[root.string()] = io::HashFile(root);
    if (!fs::is_directory(root)) return;
    for (auto it = fs::recursive_directory_iterator(root); it != fs::recursive_directory_iterator(); ++it) {
      if (it->is_directory() && it->path() == skipped) it.disable_recursion_pending();
      if (it->is_regular_file()) (*hashes)[it->path().string()] = io::HashFile(it->path());
    }
  } catch (const fs::filesystem_error& error) {
    throw io::Error(io::ExitCode::kBadInput, error.what());
  }
}

}  // namespace pipeline
