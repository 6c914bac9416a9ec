// Every stage under faults of the system (fault_shim.cpp): a call that fails ends in success or exit code 6,
// a kill or a power cut in nothing at all; then the same command finishes with the bytes of an undisturbed
// run, and no trace is left. Two places of each kind are tried; PIPELINE_FAULTS=all tries every one, and 200
// allocations.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <map>

#include "io/base/error.h"
#include "io/process/process.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/learnable_views.h"

namespace {

namespace fs = std::filesystem;
using Files = std::map<std::string, std::string>;  // contents by name

constexpr double kRunLimit_s = 60;  // an idle machine needs less than one

struct Stage {
  std::string name;
  std::vector<std::string> options;
};
const std::vector<Stage>& Stages() {
  static const std::vector<Stage> stages = {
      {"ingest", {"IMAGES"}},
      {"normalize", {"--poses", "POSES", "--image-size=0"}},
      {"train", {"--steps=20", "--batch=1024", "--grid-resolution=64", "--threads=2"}},
      {"evaluate", {"--threads=3"}},
      {"render", {"--path", "PATH", "--size=16"}},
      {"report", {}}};
  return stages;
}

struct Fault {
  std::string call, how;
};
const std::vector<Fault>& Faults() {
  static const std::vector<Fault> faults = {{"create", "fail"},
                                            {"write", "fail"},
                                            {"sync", "fail"},
                                            {"rename", "fail"},
                                            {"fork", "fail"},
                                            {"thread", "fail"},
                                            {"malloc", "fail"},
                                            {"write", "kill"},
                                            {"rename", "kill"},
                                            {"write", "power"},
                                            {"sync", "power"},
                                            {"rename", "power"}};
  return faults;
}

// A checkpoint's header states the time that training took.
std::string WithoutHeader(const std::string& checkpoint) {
  constexpr std::size_t kLengthAt = 8;
  std::uint32_t length = 0;
  if (checkpoint.size() > kLengthAt + sizeof length)
    std::memcpy(&length, checkpoint.data() + kLengthAt, sizeof length);
  return checkpoint.substr(std::min<std::size_t>(checkpoint.size(), length));
}

// Records and plots name times; their pictures and figures are compared through what they were made from.
bool HoldsTimes(const fs::path& path) {
  const std::string name = path.filename();
  return name == path.parent_path().filename().string() + ".json" || name == "run.json" ||
         name == "curve.csv" || name == "report.html" || name == ".stage.lock";
}

Files Contents(const fs::path& run) {
  Files files;
  for (const auto& entry : fs::recursive_directory_iterator(run)) {
    if (!entry.is_regular_file()) continue;
    std::string content = HoldsTimes(entry.path()) ? "" : ReadText(entry.path());
    if (entry.path().filename() == "checkpoint.bin") content = WithoutHeader(content);
    files[fs::relative(entry.path(), run)] = std::move(content);
  }
  return files;
}

std::string Difference(const Files& a, const Files& b) {
  for (const auto& [name, content] : a) {
    if (!b.contains(name)) return name + " is missing";
    if (b.at(name) != content) return name + " differs";
  }
  for (const auto& [name, content] : b) {
    if (!a.contains(name)) return name + " was left";
  }
  return "";
}

// Four views of the scene: finding a path takes longer than all else of a small film, and writes nothing.
std::string CameraPath() {
  const std::string view =
      R"({"camera_to_world": [0,0,1,4, 1,0,0,0, 0,1,0,0, 0,0,0,1], "fov": 50, "aspect": 1})";
  return R"({"render_width": 16, "render_height": 16, "fps": 4, "seconds": 1, "camera_path": [)" + view +
         "," + view + "," + view + "," + view + "]}";
}

class FaultRuns : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = std::make_unique<TempDir>();
    tests::WriteLearnableViews(*dir_ / "capture");
    WriteText(*dir_ / "path.json", CameraPath());
  }
  static void TearDownTestSuite() { dir_.reset(); }

  fs::path Run() const { return *dir_ / "run"; }
  fs::path Output() const { return *dir_ / "output"; }

  // Exit code of the stage, or 128 and the signal. call: see fault_shim.cpp; empty: undisturbed.
  int Start(const Stage& stage, const std::string& call = "", const std::string& how = "", long at = 0) {
    std::vector<std::string> command = {BINARY_DIR "/bin/pipeline-" + stage.name};
    for (std::string option : stage.options) {
      if (option == "IMAGES") option = *dir_ / "capture/images";
      if (option == "POSES") option = *dir_ / "capture/transforms.json";
      if (option == "PATH") option = *dir_ / "path.json";
      command.push_back(option);
    }
    command.insert(command.end(), {"--out", Run()});
    if (!call.empty()) {
      command.insert(command.begin(),
                     {"/usr/bin/env",
                      "LD_PRELOAD=" FAULT_SHIM,
                      "FAULT_CALL=" + call,
                      "FAULT_HOW=" + how,
                      "FAULT_AT=" + std::to_string(at),
                      "FAULT_COUNT=" + (*dir_ / "count").string()});
    }
    fs::remove(Output());
    const io::ProcessReport report =
        io::RunProcess(command, {.timeout_s = kRunLimit_s, .log_path = Output()});
    EXPECT_FALSE(report.timed_out) << stage.name << " hangs: " << call << " " << how << " " << at;
    return report.signal != 0 ? 128 + report.signal : report.exit_code;
  }

  void Restore(const fs::path& before) {
    fs::remove_all(Run());
    fs::copy(before, Run(), fs::copy_options::recursive);
  }

  // How often an undisturbed run does it.
  long Count(const Stage& stage, const std::string& call, const fs::path& before) {
    Restore(before);
    fs::remove(*dir_ / "count");
    EXPECT_EQ(Start(stage, call, "fail", 0), 0) << ReadText(Output());
    return std::atol(ReadText(*dir_ / "count").c_str());
  }

  void Try(const Stage& stage, const Fault& fault, long at, const fs::path& before, const Files& expected) {
    const std::string what = stage.name + ": " + fault.call + " " + fault.how + " " + std::to_string(at);
    Restore(before);
    const int code = Start(stage, fault.call, fault.how, at);
    if (fault.how == "fail") {
      EXPECT_TRUE(code == 0 || code == static_cast<int>(io::ExitCode::kNoResources))
          << what << ": exit code " << code << "\n"
          << ReadText(Output());
    } else {
      EXPECT_EQ(code, 128 + SIGKILL) << what;
    }
    EXPECT_EQ(Start(stage), 0) << what << ", and again:\n" << ReadText(Output());
    EXPECT_EQ(Difference(expected, Contents(Run())), "") << what;
    ++n_tried_;
  }

  static inline std::unique_ptr<TempDir> dir_;
  int n_tried_ = 0;
};

// First, last, and evenly spread between; all where they are asked for. Memory is asked for too often for
// that.
std::vector<long> Places(long n, const std::string& call) {
  constexpr long kFew = 2, kMany = 200;
  const bool all = std::getenv("PIPELINE_FAULTS") != nullptr;
  const long tried = std::min(n, !all ? kFew : call == "malloc" ? kMany : n);
  std::vector<long> places;
  for (long i = 0; i < tried; ++i) places.push_back(tried == 1 ? 1 : 1 + i * (n - 1) / (tried - 1));
  return places;
}

TEST_F(FaultRuns, NothingIsLostHalfWrittenOrWrong) {
  for (const Stage& stage : Stages()) {
    const fs::path before = *dir_ / ("before_" + stage.name);
    if (fs::exists(Run())) {
      fs::copy(Run(), before, fs::copy_options::recursive);
    } else {
      fs::create_directories(before);
    }
    ASSERT_EQ(Start(stage), 0) << stage.name << "\n" << ReadText(Output());
    const Files expected = Contents(Run());
    const fs::path after = *dir_ / ("after_" + stage.name);
    fs::copy(Run(), after, fs::copy_options::recursive);
    std::map<std::string, long> counts;
    for (const Fault& fault : Faults()) {
      // OpenCV decodes the film in threads of its own, and does not say that one of them could not start.
      if (stage.name == "render" && fault.call == "thread") continue;
      if (!counts.contains(fault.call)) counts[fault.call] = Count(stage, fault.call, before);
      for (const long at : Places(counts[fault.call], fault.call)) Try(stage, fault, at, before, expected);
    }
    Restore(after);
  }
  EXPECT_GT(n_tried_, 100);
  std::printf("%d faults\n", n_tried_);
}

}  // namespace
