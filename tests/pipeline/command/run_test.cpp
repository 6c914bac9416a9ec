// The command `pipeline` and its chain, with small scripts in place of the stages: what is forwarded, what
// ends the run, and what is recorded.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "io/base/error.h"
#include "io/base/json.h"
#include "io/process/process.h"
#include "nerf/kernels/kernels.h"
#include "pipeline/evaluation/scores.h"
#include "pipeline/ingest/run_input.h"
#include "pipeline/stage/folder_lock.h"
#include "pipeline/stage/stage_table.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;
using io::ExitCode;
using io::Json;
using pipeline::DefaultRunFolder;
using pipeline::ExamineInput;

// A folder with the real `pipeline` and, beside it, stages that log their arguments and write what is
// expected.
class FakeStages : public testing::Test {
 protected:
  FakeStages() {
    fs::create_directories(dir_ / "bin");
    for (const char* program : {"pipeline", "pipeline-run", "pipeline-doctor"})
      fs::copy_file(fs::path(BINARY_DIR) / "bin" / program, dir_ / "bin" / program);
    fs::create_directories(dir_ / "photos");
    for (const pipeline::StageEntry& stage : pipeline::StageTable()) Fake(stage, "");
    SetScores(29, 28);
  }

  // What the fake `evaluate` writes.
  void SetScores(double training_db, double heldout_db) {
    pipeline::Scores scores{.protocol = "capture", .width = 8, .height = 6};
    scores.views.push_back({.name = "a.png", .psnr_db = heldout_db});
    scores.training_psnr_db = training_db;
    pipeline::WriteScores(scores, dir_.path());
  }

  // behaviour: shell code that runs between the log and the products.
  void Fake(const pipeline::StageEntry& stage, const std::string& behaviour) {
    const std::string folder = stage.folder;
    const fs::path program = dir_ / ("bin/pipeline-" + std::string(stage.name));
    WriteText(program,
              "#!/bin/sh\nprintf '" + std::string(stage.name) + "' >> " + (dir_ / "log").string() +
                  "\nprintf ' <%s>' \"$@\" >> " + (dir_ / "log").string() + "\necho >> " +
                  (dir_ / "log").string() + "\n[ \"$1\" = --out ] || shift\nout=$2\n" + behaviour +
                  "\nmkdir -p \"$out/" + folder +
                  "\"\necho '{\"status\": \"done\", \"wall_s\": 1.5}' > \"$out/" + folder + "/" + folder +
                  ".json\"\n[ " + folder + " != evaluate ] || cp " + (dir_ / "metrics.json").string() +
                  " \"$out/evaluate\"\n: > \"$out/report.html\"; [ ! -d \"$out/render\" ] || : > "
                  "\"$out/render/novel_view.mp4\"\n");
    fs::permissions(program, fs::perms::owner_all);
  }
  void Fake(const std::string& name, const std::string& behaviour) {
    for (const pipeline::StageEntry& stage : pipeline::StageTable()) {
      if (stage.name == name) Fake(stage, behaviour);
    }
  }

  int Pipeline(std::vector<std::string> arguments) {
    fs::remove(dir_ / "log");
    fs::remove(dir_ / "output");
    arguments.insert(arguments.begin(), (dir_ / "bin/pipeline").string());
    return io::RunProcess(arguments, {.timeout_s = 20, .log_path = dir_ / "output"}).exit_code;
  }
  std::string Log() const { return ReadText(dir_ / "log"); }
  std::string Output() const { return ReadText(dir_ / "output"); }
  long OutputLines(const std::string& part) const {
    std::istringstream lines(Output());
    long n = 0;
    for (std::string line; std::getline(lines, line);) n += line.find(part) != std::string::npos;
    return n;
  }

  TempDir dir_;
};

TEST_F(FakeStages, ChainRunsEveryStageOnceInOrder) {
  ASSERT_EQ(Pipeline({"run", (dir_ / "photos/").string()}), 0) << Output();
  const std::string out = (dir_ / "photos.run").string(), common = " <--out> <" + out + ">\n";
  EXPECT_EQ(Log(),
            "ingest <" + (dir_ / "photos").string() + ">" + common + "sfm" + common + "normalize" + common +
                "train" + common + "evaluate" + common + "render" + common + "report" + common);
  EXPECT_EQ(OutputLines("film    " + out + "/render/novel_view.mp4"), 1);
  EXPECT_EQ(OutputLines("report  " + out + "/report.html"), 1);
  EXPECT_EQ(OutputLines("time    10.5 s (ingest 1.5 s, sfm 1.5 s"), 1);
  EXPECT_EQ(OutputLines("OpenBLAS"), 1);
  EXPECT_EQ(OutputLines(" threads; "), 1);
}

TEST_F(FakeStages, WhatWasOnlyMemorisedIsNotCalledDone) {
  SetScores(36, 13);
  const std::vector<std::string> run = {"run", (dir_ / "photos").string()};
  EXPECT_EQ(Pipeline(run), static_cast<int>(ExitCode::kNotReconstructed)) << Output();
  EXPECT_EQ(OutputLines("film    "), 1);
  EXPECT_EQ(OutputLines("report  "), 1);
  EXPECT_EQ(OutputLines("error E10: "), 1);
  EXPECT_EQ(OutputLines("memorised (36.0 dB)"), 1);
  SetScores(17, 13);  // doubtful: said in the report, but done
  EXPECT_EQ(Pipeline(run), 0) << Output();
}

TEST_F(FakeStages, OptionsReachTheirStagesAndAreRecorded) {
  const std::string out = (dir_ / "it's here").string();
  ASSERT_EQ(Pipeline({"run",
                      (dir_ / "photos").string(),
                      "--out",
                      out,
                      "--time",
                      "20s",
                      "--masks",
                      "/some/masks",
                      "--max-frames=50",
                      "--frames",
                      "0:420",
                      "--max-size=800",
                      "--features=512",
                      "--image-size=300",
                      "--holdout=sector",
                      "--holdout-every=4",
                      "--steps=9",
                      "--seed=3",
                      "--frames-out=24",
                      "--fps=12",
                      "--depth",
                      "--threads=2",
                      "--force"}),
            0)
      << Output();
  const std::string end = " <--threads=2> <--force=true>\n", begin = " <--out> <" + out + ">";
  EXPECT_EQ(Log(),
            "ingest <" + (dir_ / "photos").string() + ">" + begin +
                " <--masks=/some/masks> <--max-frames=50> <--frames=0:420> <--max-size=800>" + end + "sfm" +
                begin + " <--features=512>" + end + "normalize" + begin +
                " <--image-size=300> <--holdout=sector> <--holdout-every=4>" + end + "train" + begin +
                " <--time=20s> <--steps=9> <--seed=3>" + end + "evaluate" + begin + end + "render" + begin +
                " <--frames=24> <--fps=12> <--depth=true>" + end + "report" + begin + end);
  const Json record = io::ParseJson(ReadText(fs::path(out) / "run.json"));
  EXPECT_EQ(record["input"], (dir_ / "photos").string());
  EXPECT_EQ(record["options"]["seed"], (Json{{"value", 3}, {"origin", "flag"}}));
  EXPECT_EQ(record["commands"].size(), 7u);
  EXPECT_EQ(record["commands"]["sfm"],
            "pipeline sfm --out '" + dir_.path().string() +
                "/it'\\''s here' --features=512 --threads=2 --force=true");
}

TEST_F(FakeStages, FailingStageEndsTheRunWithItsCodeAndItsLine) {
  Fake("sfm", "echo 'pipeline sfm: error E4: no overlap' >&2; exit 4");
  EXPECT_EQ(Pipeline({"run", (dir_ / "photos").string()}), 4);
  EXPECT_EQ(Log().find("normalize"), std::string::npos);
  EXPECT_TRUE(Output().ends_with("pipeline sfm: error E4: no overlap\n")) << Output();
  EXPECT_EQ(OutputLines("error"), 1);
}

TEST_F(FakeStages, SilentSuccessAndDeathAreNotBelieved) {
  Fake("normalize", "exit 0");
  EXPECT_EQ(Pipeline({"run", (dir_ / "photos").string()}), 70);
  EXPECT_EQ(OutputLines("normalize ended without its record"), 1);
  Fake("normalize", "kill -9 $$");
  EXPECT_EQ(Pipeline({"run", (dir_ / "photos").string()}), 137);
  EXPECT_EQ(OutputLines("normalize was ended by signal 9 (out of memory?)"), 1);
  Fake("normalize", "");
  Fake("report",
       "mkdir -p $out/report; echo '{\"status\": \"done\"}' > $out/report/report.json; rm -f "
       "$out/report.html; exit 0");
  EXPECT_EQ(Pipeline({"run", (dir_ / "photos").string()}), 70);
  EXPECT_EQ(OutputLines("report.html: was not written"), 1);
  fs::remove(dir_ / "bin/pipeline-train");
  EXPECT_EQ(Pipeline({"run", (dir_ / "photos").string()}), 5);
  EXPECT_EQ(OutputLines("pipeline-train: is missing"), 1);
}

TEST_F(FakeStages, InterruptStopsTheStageAndTheRun) {
  Fake("train",
       "trap 'echo stopped >> " + (dir_ / "log").string() + "; exit 130' INT; : > " +
           (dir_ / "training").string() + "; while :; do sleep 0.02; done");
  const pid_t child = fork();
  if (child == 0) _exit(Pipeline({"run", (dir_ / "photos").string()}));
  for (int i = 0; i < 500 && !fs::exists(dir_ / "training"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  // The process that the child of this test started is the only one with our copy of the program.
  pid_t run = 0;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    std::error_code error;
    const fs::path program = fs::read_symlink(entry.path() / "exe", error);
    if (!error && program == dir_ / "bin/pipeline-run") run = std::stoi(entry.path().filename());
  }
  ASSERT_GT(run, 0);
  const auto start = std::chrono::steady_clock::now();
  kill(run, SIGINT);
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(3));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  EXPECT_TRUE(Log().ends_with("stopped\n")) << Log();
  EXPECT_EQ(OutputLines("stopped by signal 2; the same command continues"), 1);
}

TEST_F(FakeStages, InputWithPosesEntersAtNormalize) {
  WriteText(dir_ / "fox/transforms.json", "{}");
  ASSERT_EQ(Pipeline({"run", (dir_ / "fox").string(), "--out", (dir_ / "a").string()}), 0) << Output();
  EXPECT_TRUE(Log().starts_with("normalize <--out> <" + (dir_ / "a").string() + "> <--poses> <" +
                                (dir_ / "fox").string() + ">\ntrain"))
      << Log();
  WriteText(dir_ / "ws/sparse/0/cameras.bin", "");
  WriteText(dir_ / "ws/sparse/0/images.bin", "");
  WriteText(dir_ / "ws/sparse/0/points3D.bin", "");
  fs::create_directory(dir_ / "ws/images");
  ASSERT_EQ(Pipeline({"run", (dir_ / "ws").string(), "--out", (dir_ / "b").string()}), 0) << Output();
  EXPECT_TRUE(Log().starts_with("normalize <--out> <" + (dir_ / "b").string() + "> <--poses> <" +
                                (dir_ / "ws/sparse/0").string() + "> <--images> <" +
                                (dir_ / "ws/images").string() + ">\ntrain"))
      << Log();
  EXPECT_EQ(Pipeline({"run", (dir_ / "fox").string(), "--masks", "m", "--out", (dir_ / "d").string()}), 2);
  EXPECT_EQ(OutputLines("mask_path"), 1);
  EXPECT_FALSE(fs::exists(dir_ / "d"));
  Pipeline({"run", (dir_ / "photos").string(), "--out", (dir_ / "c").string()});
  EXPECT_EQ(Pipeline({"run", (dir_ / "fox").string(), "--out", (dir_ / "c").string()}), 2);
  EXPECT_EQ(OutputLines("holds a run of pictures"), 1);
}

TEST_F(FakeStages, TheInputsOwnFolderIsNoRunFolder) {
  WriteText(dir_ / "lego/transforms_train.json", "{}");
  WriteText(dir_ / "lego/train/r_0.png", "the user's");
  fs::create_directory_symlink(dir_ / "lego", dir_ / "link");
  for (const char* out : {"lego", "lego/.", "link"}) {
    EXPECT_EQ(Pipeline({"run", (dir_ / "lego").string(), "--out", (dir_ / out).string()}), 3) << out;
    EXPECT_EQ(OutputLines("holds files that this program did not write"), 1);
  }
  EXPECT_EQ(CountEntries(dir_ / "lego"), 3);
  EXPECT_EQ(Log(), "");
}

TEST_F(FakeStages, UnusableCommandLinesFailBeforeAnyWork) {
  const std::string photos = (dir_ / "photos").string();
  WriteText(dir_ / "file", "");
  EXPECT_EQ(Pipeline({"run"}), 2);
  EXPECT_EQ(Pipeline({"run", photos, "--tiem=5m"}), 2);
  EXPECT_EQ(OutputLines("Did you mean --time?"), 1);
  EXPECT_EQ(Pipeline({"run", photos, "--time=5x"}), 2);
  EXPECT_EQ(Pipeline({"run", photos, "--fps=0"}), 2);  // as `render` would, half an hour later
  EXPECT_EQ(OutputLines("--fps: 0 is out of range"), 1);
  EXPECT_EQ(Pipeline({"run", photos, "--target=30dB", "--steps=5"}), 2);
  EXPECT_EQ(Pipeline({"run", (dir_ / "none").string()}), 3);
  EXPECT_EQ(OutputLines("none: no such file or folder"), 1);
  EXPECT_EQ(Pipeline({"run", photos, "--out", (dir_ / "file").string()}), 2);
  EXPECT_FALSE(fs::exists(dir_ / "photos.run"));
  EXPECT_EQ(Log(), "");
  const pipeline::FolderLock lock(dir_ / "photos.run", "run");
  EXPECT_EQ(Pipeline({"run", photos}), 7);
  EXPECT_EQ(Log(), "");
}

TEST_F(FakeStages, CommandStartsStagesAndExplainsItself) {
  EXPECT_EQ(Pipeline({"train", "--out", "x y", "--steps=3"}), 0) << Output();
  EXPECT_EQ(Log(), "train <--out> <x y> <--steps=3>\n");
  fs::remove_all("x y");
  EXPECT_EQ(Pipeline({"trian"}), 2);
  EXPECT_EQ(OutputLines("unknown command 'trian'. Did you mean train?"), 1);
  EXPECT_EQ(Pipeline({"--version"}), 0);
  EXPECT_TRUE(io::ParseJson(Output()).contains("pipeline"));
  EXPECT_EQ(Pipeline({}), 2);
  EXPECT_EQ(Pipeline({"run", "--help"}), 0);
  // The stages' own help and defaults.
  for (const char* part : {"for a long walk (render); at least 0, at most 216000 [0]",
                           "(train) [\"3m\"]",
                           "beyond 400 pictures down to 2048 (sfm); at least 0, at most 16384 [0]",
                           "(normalize); at least 0 [512]",
                           "(ingest); at least 3 [120]"})
    EXPECT_EQ(OutputLines(part), 1) << part << Output();
  EXPECT_EQ(Pipeline({"--help"}), 0);
  for (const pipeline::StageEntry& stage : pipeline::StageTable())
    EXPECT_GE(OutputLines(stage.help), 1) << stage.name;
  for (const char* part : {"pipeline run photos/", "doctor", "exit codes"})
    EXPECT_GE(OutputLines(part), 1) << part;
}

TEST_F(FakeStages, DoctorNamesWhatIsHereAndWhatIsMissing) {
  EXPECT_EQ(Pipeline({"doctor"}), 0) << Output();
  for (const char* part : {"CPU ", "SIMD ", "memory ", "disk ", "GFLOP/s", "COLMAP ", "ffmpeg "})
    EXPECT_EQ(OutputLines(part), 1) << part;
  EXPECT_EQ(OutputLines("pipeline-export is missing: apt install libmeshoptimizer-dev"), 1) << Output();
  fs::create_symlink(BINARY_DIR "/bin/pipeline-export", dir_ / "bin/pipeline-export");
  EXPECT_EQ(Pipeline({"doctor"}), 0) << Output();
  EXPECT_EQ(OutputLines("export   meshes and other exports ("), 1) << Output();
  EXPECT_EQ(Pipeline({"doctor", "--out", (dir_ / "absent").string()}), 3);
  EXPECT_EQ(OutputLines("absent: No such file or directory"), 1) << Output();
  // Without a place to print to, files must not take that place.
  const std::string closed = (dir_ / "bin/pipeline").string() + " doctor >&- 2>&-";
  EXPECT_EQ(io::RunProcess({"/bin/sh", "-c", closed}, {.timeout_s = 20}).exit_code, 0);
  // The kernels that run, not those that the processor could run.
  setenv("PIPELINE_SIMD", "portable", 1);
  EXPECT_EQ(Pipeline({"doctor"}), 0) << Output();
  EXPECT_EQ(OutputLines("SIMD     portable kernels (PIPELINE_SIMD is set), bfloat16 widened"), 1) << Output();
  Pipeline({"run", (dir_ / "photos").string()});
  EXPECT_EQ(OutputLines("; portable; "), 1) << Output();
  unsetenv("PIPELINE_SIMD");
  EXPECT_EQ(Pipeline({"doctor"}), 0);
  EXPECT_EQ(OutputLines("SIMD     " + std::string(nerf::kernels::ActiveKernels().name) + " kernels, "), 1);
  const std::string path = std::getenv("PATH");
  setenv("PATH", dir_.path().c_str(), 1);
  EXPECT_EQ(Pipeline({"doctor"}), 5);
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(OutputLines("apt install colmap"), 1);
  EXPECT_EQ(OutputLines("apt install ffmpeg"), 1);
  EXPECT_EQ(OutputLines("error E5: COLMAP and ffmpeg cannot be used"), 1);
}

TEST(RunInput, KindsAndDefaultFolders) {
  const TempDir dir;
  WriteText(dir / "my.photos/1.jpg", "");
  WriteText(dir / "video.v2.mp4", "");
  WriteText(dir / "set/transforms_train.json", "{}");
  for (const char* name : {"cameras.txt", "images.txt", "points3D.txt"}) WriteText(dir / "model" / name, "");
  const auto folder = [&](const std::string& input) { return DefaultRunFolder(dir / input).string(); };
  const auto poses = [&](const std::string& input) { return ExamineInput(dir / input).poses; };
  const std::string root = dir.path().string();
  EXPECT_EQ(folder("my.photos/"), root + "/my.photos.run");
  EXPECT_EQ(folder("my.photos/../my.photos/."), root + "/my.photos.run");
  EXPECT_EQ(folder("video.v2.mp4"), root + "/video.v2.run");
  EXPECT_EQ(folder("my.photos/*.jpg"), root + "/my.photos.run");
  EXPECT_EQ(folder("set/transforms_train.json"), root + "/set/transforms_train.run");
  EXPECT_EQ(poses("my.photos"), "");
  EXPECT_EQ(poses("my.photos/*.jpg"), "");
  EXPECT_EQ(poses("video.v2.mp4"), "");
  EXPECT_EQ(poses("set"), dir / "set");
  EXPECT_EQ(poses("set/transforms_train.json"), dir / "set/transforms_train.json");
  EXPECT_EQ(poses("model"), dir / "model");
  EXPECT_ERROR(ExamineInput(dir / "none"), ExitCode::kBadInput, "none: no such file or folder");
}

}  // namespace
