// Support for tests: an own folder that disappears with the test, and small files.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

class TempDir {
 public:
  TempDir() {
    std::string name = (std::filesystem::temp_directory_path() / "pipeline_test_XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~TempDir() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

inline void WriteText(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

inline std::string ReadText(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

// Number of entries below a folder, at any depth.
inline long CountEntries(const std::filesystem::path& folder) {
  const auto walk = std::filesystem::recursive_directory_iterator(folder);
  return std::distance(begin(walk), end(walk));
}

// `body` must throw io::Error (include io/base/error.h) with this exit code and a message that contains
// every one of the texts that follow.
#define EXPECT_ERROR(body, expected_code, ...)                                                     \
  try {                                                                                            \
    body;                                                                                          \
    ADD_FAILURE() << #body << " did not throw";                                                    \
  } catch (const io::Error& error) {                                                               \
    EXPECT_EQ(static_cast<int>(error.code()), static_cast<int>(expected_code));                    \
    for (const std::string& expected_text : std::vector<std::string>{__VA_ARGS__})                 \
      EXPECT_NE(std::string(error.what()).find(expected_text), std::string::npos) << error.what(); \
  }
