// From photographs to film and report with the real programs: killed in every stage and continued, entered
// with known poses, and refused with the documented exit codes.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <opencv2/videoio.hpp>
#include <thread>

#include "io/base/json.h"
#include "io/process/process.h"
#include "pipeline/stage/stage_table.h"
#include "samples/capture.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;
using io::Json;

constexpr int kPhotos = 24, kFilmFrames = 12;
constexpr double kMinPsnr = 19;                   // after 400 steps at 160 x 120
constexpr int kMinInterrupted = 4;                // of seven stages: the long ones
constexpr double kQuickRerun_s = 10;              // hashing and starting eight programs
constexpr double kMaxMemory = 700.0 * (1 << 20);  // what the run is given
constexpr double kMaxStage_s = 300;               // an idle machine needs a tenth

Json ReadJson(const fs::path& path) { return io::ParseJson(ReadText(path)); }

class EndToEnd : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = std::make_unique<TempDir>();
    Capture("still_life", samples::CaptureKind::kPhotos, kPhotos, 480);
  }
  static void TearDownTestSuite() { dir_.reset(); }

  static void Capture(const std::string& name, samples::CaptureKind kind, int photos, int width) {
    samples::WriteCapture(
        {.out = Path(name), .kind = kind, .photos = photos, .width = width, .threads = 2, .test_views = 0});
  }
  static fs::path Path(const std::string& name) { return *dir_ / name; }

  static std::vector<std::string> Command(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {BINARY_DIR "/bin/pipeline", "run"});
    return arguments;
  }
  static int Run(const std::vector<std::string>& arguments) {
    fs::remove(Path("output"));
    return io::RunProcess(Command(arguments), {.timeout_s = 200, .log_path = Path("output")}).exit_code;
  }
  static std::string Output() { return ReadText(Path("output")); }

  // Starts the run and kills it the hard way, with all that it started, once `stage` is at work, or already
  // done: a short one may be over between two looks.
  static void KillIn(const std::string& stage,
                     const std::vector<std::string>& arguments,
                     const fs::path& out) {
    const pid_t child = fork();
    if (child == 0) {
      io::RunProcess(Command(arguments), {.log_path = Path("output")});
      _exit(0);
    }
    const auto start = std::chrono::steady_clock::now();
    std::string status;
    while (status != "running" && status != "done" &&
           std::chrono::steady_clock::now() - start < std::chrono::duration<double>(kMaxStage_s)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      const Json record = ReadJson(out / "run.json");
      if (record.is_object() && record.contains("stages") && record["stages"].contains(stage))
        status = record["stages"][stage].value("status", "");
    }
    EXPECT_TRUE(status == "running" || status == "done") << stage << "\n" << Output();
    std::this_thread::sleep_for(std::chrono::milliseconds(status == "done" ? 0 : 100));
    kill(child, SIGKILL);  // the others follow: each dies with its parent
    waitpid(child, nullptr, 0);
  }

  static std::unique_ptr<TempDir> dir_;
};
std::unique_ptr<TempDir> EndToEnd::dir_;

TEST_F(EndToEnd, KilledInEveryStageAndContinuedThePhotosBecomeFilmAndReport) {
  const fs::path out = Path("run");
  const std::vector<std::string> arguments = {Path("still_life/photos").string(),
                                              "--out",
                                              out.string(),
                                              "--features=1024",
                                              "--steps=400",
                                              "--image-size=160",
                                              "--memory=700M",
                                              "--frames-out=" + std::to_string(kFilmFrames)};
  int n_interrupted = 0;
  for (const pipeline::StageEntry& stage : pipeline::StageTable()) {
    KillIn(stage.name, arguments, out);
    ASSERT_FALSE(HasFailure());
    const fs::path result = out / stage.folder;
    if (!fs::exists(result)) {
      ++n_interrupted;
    } else {  // the kill came too late: then all of it is there
      EXPECT_EQ(ReadJson(result / (std::string(stage.folder) + ".json"))["status"], "done") << stage.name;
    }
  }
  EXPECT_GE(n_interrupted, kMinInterrupted);
  ASSERT_EQ(Run(arguments), 0) << Output();

  for (const pipeline::StageEntry& stage : pipeline::StageTable()) {
    const Json record = ReadJson(out / stage.folder / (std::string(stage.folder) + ".json"));
    EXPECT_LE(record["peak_rss_bytes"].get<double>(), kMaxMemory) << stage.name;
  }
  EXPECT_EQ(ReadJson(out / "ingest/ingest.json")["kept"], kPhotos);
  EXPECT_GE(ReadJson(out / "sfm/sfm.json")["registered"].get<int>(), kPhotos - 1);
  const Json metrics = ReadJson(out / "evaluate/metrics.json");
  EXPECT_EQ(metrics["protocol"], "capture");
  EXPECT_EQ(metrics["images"].size(), 3u);  // every 8th of 24
  EXPECT_GE(metrics["psnr"].get<double>(), kMinPsnr);
  EXPECT_GE(metrics["error_budget"]["pose_fitted_psnr"].get<double>(), metrics["psnr"].get<double>());
  RecordProperty("psnr", io::DumpJson(metrics["psnr"]));
  std::printf("held-out PSNR %s dB\n", io::DumpJson(metrics["psnr"]).c_str());
  cv::VideoCapture film((out / "render/novel_view.mp4").string());
  int n_frames = 0;
  for (cv::Mat frame; film.read(frame);) ++n_frames;
  EXPECT_EQ(n_frames, kFilmFrames);
  EXPECT_GT(fs::file_size(out / "report.html"), 100000u);
  EXPECT_NE(Output().find("film    " + (out / "render/novel_view.mp4").string()), std::string::npos);

  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(Run(arguments), 0) << Output();
  EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(), kQuickRerun_s);
  for (const pipeline::StageEntry& stage : pipeline::StageTable())
    EXPECT_NE(Output().find(std::string(stage.name) + ": up to date"), std::string::npos) << Output();
}

TEST_F(EndToEnd, KnownPosesEnterAtNormalize) {
  const fs::path out = Path("posed");
  ASSERT_EQ(Run({Path("still_life/truth/transforms.json").string(),
                 "--out",
                 out.string(),
                 "--steps=300",
                 "--image-size=120",
                 "--frames-out=8"}),
            0)
      << Output();
  EXPECT_FALSE(fs::exists(out / "ingest"));
  EXPECT_FALSE(fs::exists(out / "sfm"));
  EXPECT_TRUE(fs::exists(out / "report.html"));
}

TEST_F(EndToEnd, UnusableInputEndsWithTheDocumentedCodeAndOneLine) {
  fs::create_directory(Path("empty"));
  fs::create_directory(Path("one"));
  fs::copy_file(Path("still_life/photos/IMG_0001.jpg"), Path("one/IMG_0001.jpg"));
  WriteText(Path("text/a.jpg"), "this is no picture");
  WriteText(Path("file"), "");
  Capture("rotation", samples::CaptureKind::kRotation, 12, 320);
  const std::string photos = Path("still_life/photos").string(), out = Path("failed").string();
  struct Case {
    std::vector<std::string> arguments;
    int exit_code;
  };
  const std::vector<Case> cases = {
      {{Path("empty").string(), "--out", out}, 3},
      {{Path("one").string(), "--out", out}, 4},
      {{Path("text").string(), "--out", out}, 3},
      {{Path("nonexistent").string(), "--out", out}, 3},
      {{Path("rotation/photos").string(), "--out", out}, 4},
      {{photos, "--out", out, "--qualty=9"}, 2},
      {{photos, "--out", out, "--memory=64M"}, 6},
      {{photos, "--out", Path("file").string()}, 2},
  };
  for (const Case& one : cases) {
    EXPECT_EQ(Run(one.arguments), one.exit_code) << one.arguments[0] << "\n" << Output();
    const std::string output = Output(), mark = ": error E" + std::to_string(one.exit_code) + ": ";
    const std::size_t at = output.find(mark);
    EXPECT_NE(at, std::string::npos) << output;
    EXPECT_EQ(output.find(": error E", at + 1), std::string::npos) << output;
    EXPECT_EQ(output.find('\n', at), output.size() - 1) << output;  // the last line
  }
  EXPECT_FALSE(fs::exists(fs::path(out) / "train"));
}

}  // namespace
