// One process at a time works in a run folder.
#pragma once

#include <filesystem>
#include <string>

namespace pipeline {

// Held while a process works in a run folder, which it makes ours (io/base/owned_folder.h); the kernel frees
// it when the owner dies. Throws kLocked naming the owner.
class FolderLock {
 public:
  FolderLock(const std::filesystem::path& run_folder, const std::string& name);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int fd_ = -1;
};

}  // namespace pipeline
