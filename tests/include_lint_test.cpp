// The dependency rule of the house: io <- sfm <- pipeline, io <- nerf <- pipeline; heavy libraries behind
// fences; files of a readable size.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxHeaderLines = 150, kMaxSourceLines = 350;
constexpr std::size_t kPlausibleFiles = 40;  // fewer means that the walk went wrong

// Which of our folders a folder may include.
const std::map<std::string, std::set<std::string>> kAllowed = {
    {"io", {"io"}},
    {"sfm", {"io", "sfm"}},
    {"nerf", {"io", "nerf"}},
    {"pipeline", {"io", "sfm", "nerf", "pipeline"}},
};

struct Fence {
  std::string what;
  std::regex include;  // of the included name
  std::regex files;    // the only files that may include it
};
const std::vector<Fence> kFences = {
    {"OpenCV stays in .cpp files", std::regex("opencv2/.*"), std::regex(R"(.*\.cpp)")},
    {"JSON stays in .cpp files", std::regex("nlohmann/.*"), std::regex(R"(.*\.cpp)")},
    {"torch stays in nerf/", std::regex("(torch|ATen|c10)/.*"), std::regex("nerf/.*")},
    {"Ceres, COLMAP and SQLite stay in sfm/",
     std::regex("(ceres|colmap)/.*|sqlite3.h"),
     std::regex("sfm/.*")},
    {"intrinsics stay in kernels/",
     std::regex("immintrin.h|x86intrin.h|hwy/.*"),
     std::regex("(nerf|sfm)/kernels/.*")},
};

struct File {
  std::string name;  // relative to the repository
  std::vector<std::string> lines;
};

std::vector<File> ReadSources() {
  std::vector<File> files;
  for (const auto& [folder, allowed] : kAllowed) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(SOURCE_DIR) / folder)) {
      const std::string extension = entry.path().extension();
      if (extension != ".h" && extension != ".cpp") continue;
      File file{entry.path().lexically_relative(SOURCE_DIR).string(), {}};
      std::ifstream in(entry.path());
      for (std::string line; std::getline(in, line);) file.lines.push_back(line);
      files.push_back(std::move(file));
    }
  }
  return files;
}

std::vector<std::string> Includes(const File& file) {
  static const std::regex pattern(R"re(^\s*#\s*include\s*[<"]([^>"]+)[>"].*)re");
  std::vector<std::string> includes;
  for (const std::string& line : file.lines) {
    std::smatch match;
    if (std::regex_match(line, match, pattern)) includes.push_back(match[1]);
  }
  return includes;
}

// Every breach of the rules, one line each.
std::vector<std::string> Faults(const File& file) {
  std::vector<std::string> faults;
  const std::set<std::string>& allowed = kAllowed.at(file.name.substr(0, file.name.find('/')));
  for (const std::string& include : Includes(file)) {
    const std::string folder = include.substr(0, include.find('/'));
    const bool is_ours = include.find('/') != std::string::npos &&
                         (kAllowed.count(folder) || folder == "tests" || folder == "samples");
    if (is_ours && !allowed.count(folder)) faults.push_back(file.name + " includes " + include);
    for (const Fence& fence : kFences) {
      if (std::regex_match(include, fence.include) && !std::regex_match(file.name, fence.files))
        faults.push_back(file.name + " includes " + include + ": " + fence.what);
    }
  }
  const bool is_header = file.name.ends_with(".h");
  if (is_header && std::find(file.lines.begin(), file.lines.end(), "#pragma once") == file.lines.end())
    faults.push_back(file.name + " lacks #pragma once");
  if (file.lines.empty() || (!file.lines[0].starts_with("//") && !file.lines[0].starts_with("#include")))
    faults.push_back(file.name + " does not begin with a comment or an include");
  if (is_header && !file.lines.empty() && !file.lines[0].starts_with("//"))
    faults.push_back(file.name + " does not say what it is for");
  const std::size_t limit = is_header ? kMaxHeaderLines : kMaxSourceLines;
  if (file.lines.size() > limit)
    faults.push_back(file.name + " has " + std::to_string(file.lines.size()) + " lines, more than " +
                     std::to_string(limit));
  return faults;
}

TEST(IncludeLint, EveryFileKeepsTheRules) {
  const std::vector<File> files = ReadSources();
  EXPECT_GT(files.size(), kPlausibleFiles);
  std::set<std::string> folders;
  std::size_t n_includes = 0;
  for (const File& file : files) {
    folders.insert(file.name.substr(0, file.name.find('/')));
    n_includes += Includes(file).size();
    for (const std::string& fault : Faults(file)) ADD_FAILURE() << fault;
  }
  EXPECT_EQ(folders.size(), kAllowed.size());
  EXPECT_GT(n_includes, 4 * files.size());
}

TEST(IncludeLint, FindsEveryKindOfBreach) {
  const auto count = [](const std::string& name, std::vector<std::string> lines) {
    return Faults({name, std::move(lines)}).size();
  };
  EXPECT_EQ(count("io/a.h", {"// A.", "#pragma once", "#include \"io/b.h\"", "#include <vector>"}), 0u);
  EXPECT_EQ(count("io/a.cpp", {"#include \"sfm/b.h\""}), 1u);
  EXPECT_EQ(count("sfm/a.cpp", {"#include \"nerf/b.h\""}), 1u);
  EXPECT_EQ(count("nerf/a.cpp", {"#include \"sfm/b.h\""}), 1u);
  EXPECT_EQ(count("nerf/a.cpp", {"#include \"pipeline/b.h\""}), 1u);
  EXPECT_EQ(count("pipeline/a.cpp", {"#include \"tests/b.h\""}), 1u);
  EXPECT_EQ(count("io/a.h", {"// A.", "#pragma once", "#include <opencv2/core.hpp>"}), 1u);
  EXPECT_EQ(count("io/a.h", {"// A.", "#pragma once", "#  include <nlohmann/json.hpp>"}), 1u);
  EXPECT_EQ(count("pipeline/a.cpp", {"#include <torch/torch.h>"}), 1u);
  EXPECT_EQ(count("pipeline/a.cpp", {"#include <sqlite3.h>"}), 1u);
  EXPECT_EQ(count("nerf/a.cpp", {"#include <immintrin.h>"}), 1u);
  EXPECT_EQ(count("nerf/kernels/a.cpp", {"#include <immintrin.h>"}), 0u);
  EXPECT_EQ(count("io/a.h", {"// A."}), 1u);
  EXPECT_EQ(count("io/a.cpp", {"int x;"}), 1u);
  EXPECT_EQ(count("io/a.cpp", std::vector<std::string>(kMaxSourceLines + 1, "// A.")), 1u);
}

}  // namespace
