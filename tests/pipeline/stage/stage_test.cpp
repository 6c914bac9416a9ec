// pipeline/stage/stage.h and pipeline/stage/run_record.h: the cache, the commit of outputs, the lock, and
// what a killed stage leaves.
#include "io/base/json.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/folder_lock.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_run.h"
#include "pipeline/stage/stage_table.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "pipeline/stage/run_record.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;
using io::ExitCode;
using io::Json;
using pipeline::CommonOptions;
using pipeline::FolderLock;
using pipeline::Options;
using pipeline::StageRun;

// A stage named "normalize" (its folder is "scene") that doubles the number in its input file.
struct Doubling {
  explicit Doubling(const TempDir& dir) : input(dir / "in/number.txt"), run(dir / "run") {
    WriteText(input, "21");
  }

  // True when it had to work.
  bool Run(int factor = 2, int threads = 0, bool force = false, std::vector<fs::path> inputs = {}) const {
    CommonOptions common{.out = run, .force = force, .threads = threads};
    Options options("pipeline normalize", "Doubles.");
    options.Add("factor", &factor, "factor");
    pipeline::AddCommonOptions(&options, &common);
    if (inputs.empty()) inputs = {input.parent_path()};
    StageRun stage("normalize", common, options, inputs);
    if (stage.IsUpToDate()) return false;
    stage.Decide("the factor is " + std::to_string(factor));
    stage.Set("factor", factor);
    stage.Set("kind", "double");
    WriteText(stage.folder() / "sub/result.txt", std::to_string(factor * std::stoi(ReadText(input))));
    EXPECT_FALSE(fs::exists(run / "scene/sub/result.txt") && ReadText(run / "scene/sub/result.txt").empty());
    stage.Finish();
    return true;
  }
  Json Record() const { return io::ParseJson(ReadText(run / "scene/scene.json")); }
  Json Entry() const { return io::ParseJson(ReadText(run / "run.json"))["stages"]["normalize"]; }

  fs::path input, run;
};

TEST(StageRun, CommitsOutputsRecordAndRunEntry) {
  const TempDir dir;
  const Doubling stage(dir);
  EXPECT_TRUE(stage.Run());
  EXPECT_EQ(ReadText(stage.run / "scene/sub/result.txt"), "42");
  EXPECT_FALSE(fs::exists(stage.run / ".scene.partial"));
  const Json record = stage.Record();
  for (const char* key :
       {"stage", "status", "wall_s", "cpu_s", "peak_rss_bytes", "inputs", "options", "versions", "decisions"})
    EXPECT_TRUE(record.contains(key)) << key;
  EXPECT_EQ(record["status"], "done");
  EXPECT_EQ(record["factor"], 2);
  EXPECT_EQ(record["inputs"].size(), 1u);
  EXPECT_TRUE(record["inputs"].contains("../in/number.txt"));
  EXPECT_TRUE(record["outputs"].contains("sub/result.txt"));
  EXPECT_EQ(record["options"]["factor"]["origin"], "default");
  EXPECT_EQ(record["decisions"][0], "the factor is 2");
  EXPECT_GT(record["peak_rss_bytes"].get<double>(), 1 << 20);
  EXPECT_EQ(stage.Entry()["status"], "done");
  EXPECT_EQ(stage.Entry()["kind"], "double");
  EXPECT_EQ(stage.Entry()["key"], record["key"]);
  EXPECT_EQ(Json(pipeline::ReadStageRecord(stage.run, "normalize")), record);
  EXPECT_TRUE(pipeline::ReadStageRecord(stage.run, "train").is_null());
}

TEST(StageRun, SkipsExactlyWhatIsStillValid) {
  const TempDir dir;
  const Doubling stage(dir);
  EXPECT_TRUE(stage.Run());
  EXPECT_FALSE(stage.Run());
  EXPECT_FALSE(stage.Run(2, 1));       // threads do not change the result
  EXPECT_TRUE(stage.Run(2, 0, true));  // --force
  EXPECT_TRUE(stage.Run(3));           // another option
  EXPECT_EQ(ReadText(stage.run / "scene/sub/result.txt"), "63");
  EXPECT_FALSE(stage.Run(3));
  WriteText(stage.input, "5");  // another input
  EXPECT_TRUE(stage.Run(3));
  EXPECT_EQ(ReadText(stage.run / "scene/sub/result.txt"), "15");
  WriteText(stage.input.parent_path() / "more.txt", "");  // one more input
  EXPECT_TRUE(stage.Run(3));
  WriteText(stage.run / "scene/sub/result.txt", "16");  // a damaged output
  EXPECT_TRUE(stage.Run(3));
  fs::remove(stage.run / "scene/sub/result.txt");  // a missing output
  EXPECT_TRUE(stage.Run(3));
  WriteText(stage.run / "scene/scene.json", "{\"key\": 5, \"outputs\": 7");  // a damaged record
  EXPECT_TRUE(stage.Run(3));
  WriteText(stage.run / "scene/scene.json", R"({"key": 5, "outputs": 7})");
  EXPECT_TRUE(stage.Run(3));
  EXPECT_FALSE(stage.Run(3));
}

TEST(StageRun, ARecordWithAnyValueChangedIsMadeAnew) {
  const TempDir dir;
  const Doubling stage(dir);
  EXPECT_TRUE(stage.Run());
  const Json record = stage.Record();
  const fs::path file = stage.run / "scene/scene.json";
  for (const auto& member : record.items()) {
    for (const Json& value : {Json(), Json(7), Json("x"), Json(true), Json(Json::array()), Json{{"a", 1}}}) {
      Json changed = record;
      changed[member.key()] = value;
      WriteText(file, io::DumpJson(changed));
      EXPECT_TRUE(stage.Run()) << member.key() << " " << value;
    }
  }
  WriteText(file, "[1, 2]");
  EXPECT_TRUE(pipeline::ReadStageRecord(stage.run, "normalize").is_null());
  EXPECT_TRUE(stage.Run());
  EXPECT_FALSE(stage.Run());
}

TEST(RunRecord, ValuesOfOtherTypesAreAsGoodAsNone) {
  for (const Json& json : {Json(), Json(3), Json("x"), Json{{"s", 5}}, Json{{"s", Json::array()}}})
    EXPECT_EQ(pipeline::TextAt(json, "s"), "");
  EXPECT_EQ(pipeline::TextAt({{"s", "done"}}, "s"), "done");
  for (const Json& json : {Json(), Json(3), Json("x"), Json{{"n", "5"}}, Json{{"n", true}}})
    EXPECT_EQ(pipeline::NumberAt(json, "n", 2.5), 2.5);
  EXPECT_EQ(pipeline::NumberAt({{"n", 4}}, "n"), 4);
}

TEST(StageRun, InputsMayBeNamedRelativeToTheWorkingFolder) {
  const TempDir dir;
  const Doubling stage(dir);
  EXPECT_TRUE(stage.Run());
  const fs::path before = fs::current_path();
  fs::current_path(dir.path());
  EXPECT_FALSE(stage.Run(2, 0, false, {"in"}));
  EXPECT_FALSE(stage.Run(2, 0, false, {"./in/"}));
  fs::current_path(before);
}

TEST(StageRun, RunFolderInsideTheInputDoesNotCount) {
  const TempDir dir;
  Doubling stage(dir);
  stage.run = dir / "in/run";
  EXPECT_TRUE(stage.Run());
  EXPECT_FALSE(stage.Run());
  EXPECT_EQ(stage.Record()["inputs"].size(), 1u);
}

TEST(StageRun, FailureIsRecordedAndKeepsTheOldOutputs) {
  const TempDir dir;
  const Doubling stage(dir);
  stage.Run();
  WriteText(stage.input, "no number");
  EXPECT_THROW(stage.Run(), std::invalid_argument);
  EXPECT_EQ(stage.Entry()["status"], "failed");
  EXPECT_EQ(ReadText(stage.run / "scene/sub/result.txt"), "42");
  WriteText(stage.input, "21");
  EXPECT_FALSE(stage.Run());  // the old outputs belong to this input
  EXPECT_EQ(stage.Entry()["status"], "done");
}

TEST(StageRun, LostRunRecordIsRestored) {
  const TempDir dir;
  const Doubling stage(dir);
  stage.Run();
  const Json entry = stage.Entry();
  fs::remove(stage.run / "run.json");
  EXPECT_FALSE(stage.Run());
  EXPECT_EQ(stage.Entry(), entry);
  WriteText(stage.run / "run.json", "damaged");
  EXPECT_FALSE(stage.Run());
  EXPECT_EQ(stage.Entry(), entry);
}

TEST(StageRun, NothingOfTheUserIsReplaced) {
  const TempDir dir;
  Doubling stage(dir);
  // A folder of the user's as --out, named in three ways.
  WriteText(dir / "lego/scene/r_0.png", "the user's");
  fs::create_directory_symlink(dir / "lego", dir / "link");
  for (const char* out : {"lego", "lego/.", "link"}) {
    stage.run = dir / out;
    EXPECT_ERROR(stage.Run(), ExitCode::kBadInput, "did not write");
  }
  EXPECT_EQ(ReadText(dir / "lego/scene/r_0.png"), "the user's");
  EXPECT_EQ(CountEntries(dir / "lego"), 2);
  // A run folder of ours, in which the user has put a folder or a link under the name of an output.
  stage.run = dir / "run";
  stage.Run();
  for (const char* name : {"scene", ".scene.partial"}) {
    fs::remove_all(stage.run / name);
    WriteText(stage.run / name / "mine.txt", "the user's");
    EXPECT_ERROR(stage.Run(2, 0, true), ExitCode::kBadInput, name);
    EXPECT_EQ(ReadText(stage.run / name / "mine.txt"), "the user's");
    fs::remove_all(stage.run / name);
    fs::create_directory_symlink(dir / "lego/scene", stage.run / name);
    EXPECT_ERROR(stage.Run(2, 0, true), ExitCode::kBadInput, name);
    fs::remove(stage.run / name);
  }
  EXPECT_EQ(CountEntries(dir / "lego"), 2);
  EXPECT_TRUE(stage.Run());
}

TEST(StageRun, UnusableArgumentsAreNamed) {
  const TempDir dir;
  Doubling stage(dir);
  EXPECT_ERROR(stage.Run(2, 0, false, {dir / "none"}), ExitCode::kBadInput, "none: no such file");
  EXPECT_FALSE(fs::exists(stage.run));
  WriteText(dir / "file", "");
  stage.run = dir / "file";
  EXPECT_ERROR(stage.Run(), ExitCode::kUsage, "file: is not a folder");
}

TEST(StageRun, ResumesOnlyAPartialFolderOfTheSameKey) {
  const TempDir dir;
  const auto resumed = [&](const std::string& text, bool keep_partial) {
    CommonOptions common{.out = dir / "run"};
    Options options("pipeline render", "Renders.");
    std::string value = text;
    options.Add("text", &value, "text");
    const StageRun stage("render", common, options, {}, keep_partial);
    const bool found = fs::exists(stage.folder() / "frames/1.png");
    WriteText(stage.folder() / "frames/1.png", "x");
    WriteText(stage.folder() / "frames/.2.png.99.pipeline-tmp", "half a file of a killed writer");
    return found;  // without Finish: as if killed
  };
  EXPECT_FALSE(resumed("a", true));
  EXPECT_TRUE(resumed("a", true));
  EXPECT_FALSE(resumed("b", true));
  EXPECT_FALSE(resumed("a", true));
  EXPECT_FALSE(resumed("a", false));
  EXPECT_FALSE(fs::exists(dir / "run/render"));
  CommonOptions common{.out = dir / "run"};
  Options options("pipeline render", "Renders.");
  std::string value = "a";
  options.Add("text", &value, "text");
  StageRun stage("render", common, options, {}, true);
  EXPECT_FALSE(fs::exists(stage.folder() / "frames/.2.png.99.pipeline-tmp"));
  stage.Finish();
  EXPECT_EQ(CountEntries(dir / "run/render"), 4);  // the marker, frames, 1.png, render.json
}

TEST(StageRun, KilledAtAnyMomentLeavesOldOrNewAndTheRerunFinishes) {
  const TempDir dir;
  const Doubling stage(dir);
  const auto start = std::chrono::steady_clock::now();
  stage.Run();
  const std::chrono::duration<double, std::micro> one_run = std::chrono::steady_clock::now() - start;
  constexpr int kKills = 16;  // spread over somewhat more than one run
  for (int i = 0; i < kKills; ++i) {
    const int factor = 2 + i % 2;
    const pid_t child = fork();
    if (child == 0) {
      stage.Run(factor, 0, true);
      _exit(0);
    }
    usleep(static_cast<useconds_t>(1.2 * one_run.count() * i / kKills));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const int found = stage.Record()["factor"];  // complete: the record names what is there
    EXPECT_EQ(ReadText(stage.run / "scene/sub/result.txt"), found == 2 ? "42" : "63");
    stage.Run(factor);
    EXPECT_EQ(ReadText(stage.run / "scene/sub/result.txt"), factor == 2 ? "42" : "63");
    EXPECT_EQ(stage.Entry()["status"], "done");
    EXPECT_FALSE(stage.Run(factor));
    if (HasFailure()) break;
  }
}

TEST(FolderLock, SecondOwnerIsRefusedUntilTheFirstIsGone) {
  const TempDir dir;
  {
    const FolderLock lock(dir / "run", "stage");
    EXPECT_ERROR(FolderLock(dir / "run", "stage"), ExitCode::kLocked, "process " + std::to_string(getpid()));
    const FolderLock other(dir / "run", "run");  // another name is another lock
    const Doubling stage(dir);
    EXPECT_ERROR(stage.Run(), ExitCode::kLocked, "in use by");
  }
  const FolderLock again(dir / "run", "stage");
  const pid_t child = fork();
  if (child == 0) {
    try {
      const FolderLock lock(dir / "killed", "stage");
      kill(getpid(), SIGKILL);
    } catch (...) {
    }
    _exit(1);
  }
  waitpid(child, nullptr, 0);
  const FolderLock after_kill(dir / "killed", "stage");  // a dead owner does not count
}

TEST(FolderLock, ALinkInItsPlaceIsNotFollowed) {
  const TempDir dir;
  WriteText(dir / "notes.txt", "of the user");
  { const FolderLock claims(dir / "run", "other"); }
  fs::create_symlink(dir / "notes.txt", dir / "run/.stage.lock");
  EXPECT_ERROR(FolderLock(dir / "run", "stage"), ExitCode::kNoResources, ".stage.lock: cannot be locked");
  EXPECT_EQ(ReadText(dir / "notes.txt"), "of the user");
}

TEST(StageTable, AProgramThatIsNotThereIsNamed) {
  EXPECT_ERROR(pipeline::ProgramOf("nothing"), ExitCode::kMissingTool, "pipeline-nothing: is missing");
}

TEST(RunRecord, MembersAndStagesAreMerged) {
  const TempDir dir;
  fs::create_directory(dir / "run");
  pipeline::RecordRun(dir / "run", {{"input", "a"}, {"commands", {{"sfm", "x"}}}});
  pipeline::RecordStage(dir / "run", "sfm", {{"status", "done"}});
  pipeline::RecordRun(dir / "run", {{"input", "b"}});
  const Json record = io::ParseJson(ReadText(dir / "run/run.json"));
  EXPECT_EQ(record["input"], "b");
  EXPECT_EQ(record["commands"]["sfm"], "x");
  EXPECT_EQ(record["stages"]["sfm"]["status"], "done");
  EXPECT_TRUE(record["versions"].contains("pipeline"));
  EXPECT_TRUE(record["host"].contains("name"));
  EXPECT_EQ(pipeline::ReadStageEntry(dir / "run", "sfm"), (Json{{"status", "done"}}));
  EXPECT_TRUE(pipeline::ReadStageEntry(dir / "run", "train").is_null());
}

TEST(GuardedMain, TurnsExceptionsIntoOneLineAndTheExitCode) {
  const auto run = [](const std::function<void()>& body, const std::string& part) {
    testing::internal::CaptureStderr();
    const int code = pipeline::GuardedMain("pipeline test", body);
    const std::string text = testing::internal::GetCapturedStderr();
    EXPECT_NE(text.find(part), std::string::npos) << text;
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), code == 0 ? 0 : 1) << text;
    return code;
  };
  EXPECT_EQ(run([] {}, ""), 0);
  EXPECT_EQ(run([] { throw io::Error(ExitCode::kBadInput, "a.jpg: bad", "Remove it"); },
                "pipeline test: error E3: a.jpg: bad. Remove it"),
            3);
  EXPECT_EQ(run([] { throw std::bad_alloc(); }, "out of memory"), 6);
  EXPECT_EQ(run([] { throw io::Interrupted(SIGINT); }, "the same command continues"), 130);
  EXPECT_EQ(run([] { fs::create_directory("/proc/x/y"); }, "/proc/x/y"), 6);
  EXPECT_EQ(run([] { throw std::logic_error("odd"); }, "odd"), 70);
}

TEST(Memory, IsReadInGigabytesAndMegabytes) {
  EXPECT_EQ(pipeline::ParseBytes("memory", "2G"), std::size_t{2} << 30);
  EXPECT_EQ(pipeline::ParseBytes("memory", "1.5GB"), std::size_t{3} << 29);
  EXPECT_EQ(pipeline::ParseBytes("memory", "800MiB"), std::size_t{800} << 20);
  for (const char* wrong : {"", "G", "2", "2K", "2 G", "-2G", "1M", "nanG", "1e30G", "2Gx"})
    EXPECT_ERROR(pipeline::ParseBytes("memory", wrong), ExitCode::kUsage, "--memory: '");
}

TEST(Memory, IsWhatTheMachineHasFreeUnlessItIsGiven) {
  const std::size_t free = pipeline::ResolvedMemory({}).bytes();
  EXPECT_GT(free, io::HeldMemoryBytes());
  EXPECT_LT(free, std::size_t{1} << 50);
  EXPECT_EQ(io::MemoryLeftBytes(), SIZE_MAX);  // planned with, and not enforced
}

TEST(Threads, AreLimitedToWhatTheMachineCanUse) {
  const int cores = io::AvailableCores();
  EXPECT_GE(cores, 1);
  EXPECT_EQ(pipeline::ResolvedThreads({.threads = 0}), cores);
  EXPECT_EQ(pipeline::ResolvedThreads({.threads = 1}), 1);
  EXPECT_LE(pipeline::ResolvedThreads({.threads = 100000}), 4 * cores);
}

}  // namespace
