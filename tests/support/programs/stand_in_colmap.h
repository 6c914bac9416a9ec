// Support for tests: a stand-in `colmap` on PATH that does what a test tells it to.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

class StandInColmap : public testing::Test {
 protected:
  StandInColmap() {
    std::string name = (std::filesystem::temp_directory_path() / "colmap_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    old_path_ = std::getenv("PATH");
    setenv("PATH", (folder_.string() + ":/usr/bin:/bin").c_str(), 1);
  }
  ~StandInColmap() override {
    setenv("PATH", old_path_.c_str(), 1);
    std::filesystem::remove_all(folder_);
  }

  // body: what every command except `-h` does.
  void Install(const std::string& body) {
    const std::filesystem::path program = folder_ / "colmap";
    std::ofstream(program)
        << "#!/bin/sh\n"
           "if [ \"$2\" = -h ]; then cat <<END\n"
           "  --SiftExtraction.use_gpu\n  --SiftExtraction.num_threads\n"
           "  --SiftExtraction.max_image_size\n  --SiftExtraction.max_num_features\n"
           "  --SiftMatching.use_gpu\n  --SiftMatching.num_threads\n  --Mapper.num_threads\n"
           "END\nexit 0\nfi\n"
        << body << "\n";
    std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  }

  std::filesystem::path folder_;
  std::string old_path_;
};
