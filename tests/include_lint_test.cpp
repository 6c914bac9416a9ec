// The order of the house: a room includes only rooms that its library links, layers point downwards, heavy
// libraries stay behind fences, and files have a readable size.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxHeaderLines = 150, kMaxSourceLines = 350;
constexpr std::size_t kPlausibleFiles = 300, kPlausibleRooms = 20;  // fewer means that the walk went wrong
const std::set<std::string> kLayers = {"io", "sfm", "nerf", "pipeline"};

// Room -> rooms that it links, as add_room() of the layers' CMakeLists.txt has it.
using Rooms = std::map<std::string, std::set<std::string>>;

std::string Layer(const std::string& name) { return name.substr(0, name.find('/')); }

// Adds the rooms of one CMakeLists.txt.
void ParseRooms(const std::string& cmake, Rooms* rooms) {
  static const std::regex call(R"(add_room\(([^)]*)\))");
  for (std::sregex_iterator it(cmake.begin(), cmake.end(), call), end; it != end; ++it) {
    std::istringstream words((*it)[1]);
    std::string room, word, list;
    words >> room;
    std::set<std::string>& uses = (*rooms)[room];
    while (words >> word) {
      if (word == "USES" || word == "LIBRARIES" || word == "EXCEPT") {
        list = word;
      } else if (list == "USES") {
        uses.insert(word);
      }
    }
  }
}

// All that `room` may include: what it links, and what that links.
std::set<std::string> Reach(const Rooms& rooms, const std::string& room) {
  std::set<std::string> reach;
  std::vector<std::string> open = {room};
  while (!open.empty()) {
    const auto uses = rooms.find(open.back());
    open.pop_back();
    if (uses == rooms.end()) continue;
    for (const std::string& used : uses->second) {
      if (reach.insert(used).second) open.push_back(used);
    }
  }
  return reach;
}

// Every breach of the direction io <- {sfm, nerf} <- pipeline, and every circle.
std::vector<std::string> DirectionFaults(const Rooms& rooms) {
  std::vector<std::string> faults;
  for (const auto& [room, uses] : rooms) {
    const std::set<std::string> reach = Reach(rooms, room);
    if (reach.count(room)) faults.push_back(room + " uses itself in a circle");
    for (const std::string& used : reach) {
      const std::string from = Layer(room), to = Layer(used);
      const bool is_down = from == to || to == "io" || from == "pipeline";
      if (!is_down) faults.push_back(room + " uses " + used);
      if (!rooms.count(used)) faults.push_back(room + " uses " + used + ", which is no room");
    }
  }
  return faults;
}

// The room that a file, named from the repository's root, lies in; "" outside of all.
std::string RoomOf(const Rooms& rooms, const std::string& file) {
  for (fs::path folder = fs::path(file).parent_path(); !folder.empty(); folder = folder.parent_path()) {
    if (rooms.count(folder.string())) return folder.string();
  }
  return "";
}

struct Fence {
  std::string what;
  std::regex include;  // of the included name
  std::regex files;    // the only files that may include it
};
const std::vector<Fence> kFences = {
    {"OpenCV stays in .cpp files", std::regex("opencv2/.*"), std::regex(R"(.*\.cpp)")},
    {"JSON stays in .cpp files, but for its forward declarations",
     std::regex("nlohmann/(?!json_fwd\\.hpp$).*"),
     std::regex(R"(.*\.cpp)")},
    {"CLI11 stays in .cpp files", std::regex("CLI/.*"), std::regex(R"(.*\.cpp)")},
    {"torch stays in nerf/", std::regex("(torch|ATen|c10)/.*"), std::regex("nerf/.*")},
    {"Ceres, COLMAP and SQLite stay in sfm/",
     std::regex("(ceres|colmap)/.*|sqlite3.h"),
     std::regex("sfm/.*")},
    {"intrinsics stay in kernels/",
     std::regex("immintrin.h|x86intrin.h|hwy/.*"),
     std::regex("(nerf|sfm/features)/kernels/.*")},
};

struct File {
  std::string name;  // relative to the repository
  std::vector<std::string> lines;
};

std::vector<File> ReadSources() {
  std::vector<File> files;
  for (const std::string& layer : kLayers) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(SOURCE_DIR) / layer)) {
      const std::string extension = entry.path().extension();
      if (extension != ".h" && extension != ".cpp" && extension != ".inc") continue;
      File file{entry.path().lexically_relative(SOURCE_DIR).string(), {}};
      std::ifstream in(entry.path());
      for (std::string line; std::getline(in, line);) file.lines.push_back(line);
      files.push_back(std::move(file));
    }
  }
  return files;
}

Rooms ReadRooms() {
  Rooms rooms;
  for (const std::string& layer : kLayers) {
    std::ostringstream cmake;
    cmake << std::ifstream(fs::path(SOURCE_DIR) / layer / "CMakeLists.txt").rdbuf();
    ParseRooms(cmake.str(), &rooms);
  }
  return rooms;
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

std::vector<std::string> IncludeFaults(const Rooms& rooms, const File& file) {
  std::vector<std::string> faults;
  const std::string room = RoomOf(rooms, file.name);
  if (room.empty()) faults.push_back(file.name + " lies in no room");
  const std::set<std::string> reach = Reach(rooms, room);
  for (const std::string& include : Includes(file)) {
    const std::string layer = Layer(include), used = RoomOf(rooms, include);
    const bool is_ours = include.find('/') != std::string::npos &&
                         (kLayers.count(layer) || layer == "tests" || layer == "samples");
    if (is_ours && used != room && !reach.count(used))
      faults.push_back(file.name + " includes " + include + ", which " + room + " does not link");
    for (const Fence& fence : kFences) {
      if (std::regex_match(include, fence.include) && !std::regex_match(file.name, fence.files))
        faults.push_back(file.name + " includes " + include + ": " + fence.what);
    }
  }
  return faults;
}

// Names that a source may only use when a header that has them is among its includes or among those of ours
// that it includes. Presets that join the sources of a room compile without.
struct Provider {
  std::regex use, headers;
};
const std::vector<Provider> kProviders = {
    {std::regex(R"(\b(throw|const) (io::)?Error\b)"), std::regex("io/base/error.h")},
    {std::regex(R"(\bcv::|\bCV_\d)"), std::regex("opencv2/.*")},
    {std::regex(R"(\bfmt::)"), std::regex("fmt/.*")},
    {std::regex(R"(\bnlohmann::)"), std::regex("nlohmann/.*")}};

// All that a file includes, and what our headers among it do.
std::set<std::string> Included(const std::map<std::string, File>& files, const File& file) {
  std::set<std::string> included;
  std::vector<std::string> open = Includes(file);
  while (!open.empty()) {
    const std::string name = open.back();
    open.pop_back();
    const auto header = files.find(name);
    if (!included.insert(name).second || header == files.end()) continue;
    for (std::string& include : Includes(header->second)) open.push_back(std::move(include));
  }
  return included;
}

std::vector<std::string> MissingIncludes(const std::map<std::string, File>& files, const File& file) {
  std::vector<std::string> faults;
  const std::set<std::string> included = Included(files, file);
  for (const Provider& provider : kProviders) {
    const auto uses = [&](const std::string& line) {
      return std::regex_search(line.substr(0, line.find("//")), provider.use);
    };
    const auto provides = [&](const std::string& include) {
      return std::regex_match(include, provider.headers);
    };
    const auto line = std::find_if(file.lines.begin(), file.lines.end(), uses);
    if (line != file.lines.end() && std::none_of(included.begin(), included.end(), provides))
      faults.push_back(file.name + " includes no header for: " + *line);
  }
  return faults;
}

std::vector<std::string> FormFaults(const File& file) {
  std::vector<std::string> faults;
  const bool is_header = file.name.ends_with(".h");
  const std::string first = file.lines.empty() ? "" : file.lines[0];
  if (is_header && std::find(file.lines.begin(), file.lines.end(), "#pragma once") == file.lines.end())
    faults.push_back(file.name + " lacks #pragma once");
  if (!first.starts_with("//") && (is_header || !first.starts_with("#include")))
    faults.push_back(file.name + " does not say what it is for");
  const std::size_t limit = is_header ? kMaxHeaderLines : kMaxSourceLines;
  if (file.lines.size() > limit)
    faults.push_back(file.name + " has " + std::to_string(file.lines.size()) + " lines, more than " +
                     std::to_string(limit));
  return faults;
}

std::vector<std::string> Faults(const Rooms& rooms, const File& file) {
  std::vector<std::string> faults = IncludeFaults(rooms, file);
  for (std::string& fault : FormFaults(file)) faults.push_back(std::move(fault));
  return faults;
}

TEST(IncludeLint, EveryFileKeepsTheRules) {
  const Rooms rooms = ReadRooms();
  EXPECT_GT(rooms.size(), kPlausibleRooms);
  for (const std::string& fault : DirectionFaults(rooms)) ADD_FAILURE() << fault;
  const std::vector<File> files = ReadSources();
  EXPECT_GT(files.size(), kPlausibleFiles);
  std::set<std::string> used_rooms;
  std::size_t n_includes = 0;
  for (const File& file : files) {
    used_rooms.insert(RoomOf(rooms, file.name));
    n_includes += Includes(file).size();
    for (const std::string& fault : Faults(rooms, file)) ADD_FAILURE() << fault;
  }
  EXPECT_EQ(used_rooms.size(), rooms.size());
  EXPECT_GT(n_includes, 4 * files.size());
}

TEST(IncludeLint, SourcesIncludeWhatTheyUse) {
  std::map<std::string, File> files;
  for (File& file : ReadSources()) files.emplace(file.name, file);
  for (const auto& [name, file] : files) {
    if (!name.ends_with(".cpp")) continue;
    for (const std::string& fault : MissingIncludes(files, file)) ADD_FAILURE() << fault;
  }

  const std::map<std::string, File> some = {{"io/base/error.h", {"io/base/error.h", {}}},
                                            {"io/a.h", {"io/a.h", {"#include \"io/base/error.h\""}}}};
  const auto count = [&](std::vector<std::string> lines) {
    return MissingIncludes(some, {"io/a.cpp", std::move(lines)}).size();
  };
  EXPECT_EQ(count({"#include \"io/a.h\"", "throw io::Error();"}), 0u);
  EXPECT_EQ(count({"#include \"io/b.h\"", "throw io::Error();"}), 1u);
  EXPECT_EQ(count({"} catch (const Error& error) {"}), 1u);
  EXPECT_EQ(count({"// throw Error", "const ErrorBudget budget;"}), 0u);
  EXPECT_EQ(count({"#include <opencv2/core.hpp>", "cv::Mat mat(1, 1, CV_8U);"}), 0u);
  EXPECT_EQ(count({"int type = CV_8U;"}), 1u);
  EXPECT_EQ(count({"fmt::format();", "nlohmann::json json;"}), 2u);
}

TEST(IncludeLint, EveryRoomSaysWhatItIsFor) {
  for (const auto& [room, uses] : ReadRooms()) {
    std::ifstream readme(fs::path(SOURCE_DIR) / room / "README.md");
    std::string first;
    std::getline(readme, first);
    EXPECT_EQ(first, "# " + room);
  }
}

TEST(IncludeLint, FindsEveryKindOfBreach) {
  Rooms rooms;
  ParseRooms(
      "add_room(io/base LIBRARIES PkgConfig::X)\nadd_room(io/image USES io/base\n  LIBRARIES opencv_core)\n"
      "add_room(sfm/features USES io/image)\nadd_room(nerf/kernels)\nadd_room(nerf/data USES nerf/kernels)\n"
      "add_room(pipeline/stage USES sfm/features EXCEPT main.cpp)\n",
      &rooms);
  EXPECT_EQ(rooms.size(), 6u);
  EXPECT_EQ(rooms["io/image"], std::set<std::string>{"io/base"});
  EXPECT_EQ(DirectionFaults(rooms), std::vector<std::string>{});
  for (const auto& [from, to] :
       std::vector<std::pair<std::string, std::string>>{{"io/base", "sfm/features"},
                                                        {"sfm/features", "nerf/data"},
                                                        {"nerf/data", "sfm/features"},
                                                        {"nerf/data", "pipeline/stage"},
                                                        {"nerf/kernels", "nerf/data"},
                                                        {"nerf/data", "nerf/none"}}) {
    Rooms broken = rooms;
    broken[from].insert(to);
    EXPECT_FALSE(DirectionFaults(broken).empty()) << from << " " << to;
  }

  const auto count = [&](const std::string& name, std::vector<std::string> lines) {
    return Faults(rooms, {name, std::move(lines)}).size();
  };
  const auto includes = [&](const std::string& name, const std::string& include) {
    return count(name, {"#include " + include});
  };
  EXPECT_EQ(count("io/image/a.h", {"// A.", "#pragma once", "#include \"io/base/b.h\"", "#include <vector>"}),
            0u);
  EXPECT_EQ(includes("pipeline/stage/a.cpp", "\"io/base/b.h\""), 0u);  // through sfm/features and io/image
  EXPECT_EQ(includes("io/base/a.cpp", "\"io/image/b.h\""), 1u);
  EXPECT_EQ(includes("io/base/a.cpp", "\"sfm/features/b.h\""), 1u);
  EXPECT_EQ(includes("sfm/features/a.cpp", "\"nerf/data/b.h\""), 1u);
  EXPECT_EQ(includes("nerf/data/a.cpp", "\"sfm/features/b.h\""), 1u);
  EXPECT_EQ(includes("nerf/data/a.cpp", "\"pipeline/stage/b.h\""), 1u);
  EXPECT_EQ(includes("pipeline/stage/a.cpp", "\"tests/b.h\""), 1u);
  EXPECT_EQ(includes("io/loose.cpp", "<vector>"), 1u);
  EXPECT_EQ(count("io/base/a.h", {"// A.", "#pragma once", "#include <opencv2/core.hpp>"}), 1u);
  EXPECT_EQ(count("io/base/a.h", {"// A.", "#pragma once", "#  include <nlohmann/json.hpp>"}), 1u);
  EXPECT_EQ(count("io/base/a.h", {"// A.", "#pragma once", "#include <nlohmann/json_fwd.hpp>"}), 0u);
  EXPECT_EQ(count("io/base/a.h", {"// A.", "#pragma once", "#include <nlohmann/json_fwd.hpp.in>"}), 1u);
  EXPECT_EQ(count("io/base/a.h", {"// A.", "#pragma once", "#include <CLI/CLI.hpp>"}), 1u);
  EXPECT_EQ(includes("pipeline/stage/a.cpp", "<torch/torch.h>"), 1u);
  EXPECT_EQ(includes("pipeline/stage/a.cpp", "<sqlite3.h>"), 1u);
  EXPECT_EQ(includes("nerf/data/a.cpp", "<immintrin.h>"), 1u);
  EXPECT_EQ(includes("nerf/kernels/a.inc", "<immintrin.h>"), 0u);
  EXPECT_EQ(includes("sfm/features/kernels/a.cpp", "<immintrin.h>"), 0u);
  EXPECT_EQ(count("io/base/a.h", {"// A."}), 1u);
  EXPECT_EQ(count("io/base/a.h", {"#pragma once"}), 1u);
  EXPECT_EQ(count("io/base/a.cpp", {"int x;"}), 1u);
  EXPECT_EQ(count("io/base/a.inc", std::vector<std::string>(kMaxSourceLines + 1, "// A.")), 1u);
}

}  // namespace
