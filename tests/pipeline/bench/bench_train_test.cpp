// `pipeline bench train` with small scripts in place of the stages, and the figures that it derives from a
// curve.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "io/base/error.h"
#include "io/process/process.h"
#include "pipeline/bench/bench.h"
#include "pipeline/bench/training_result.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;
using io::ExitCode;
constexpr double kInf = std::numeric_limits<double>::infinity();

TEST(BenchTrain, TimeToAQualityIsLinearBetweenThePoints) {
  const std::vector<double> seconds = {1, 3, 4, 8}, psnr = {20, 30, 29, 33};
  EXPECT_DOUBLE_EQ(pipeline::SecondsTo(25, seconds, psnr), 2);
  EXPECT_DOUBLE_EQ(pipeline::SecondsTo(30, seconds, psnr), 3);
  EXPECT_DOUBLE_EQ(pipeline::SecondsTo(31, seconds, psnr), 6);  // not undone by the dip
  EXPECT_DOUBLE_EQ(pipeline::SecondsTo(15, seconds, psnr), 1);  // at the latest
  EXPECT_EQ(pipeline::SecondsTo(34, seconds, psnr), kInf);
  EXPECT_EQ(pipeline::SecondsTo(20, {}, {}), kInf);
  EXPECT_DOUBLE_EQ(pipeline::SecondsTo(25, {1, 2}, {std::nan(""), 26}), 2);
}

TEST(BenchTrain, CurvesAreReadBetweenTheirPoints) {
  const nerf::CurveColumns curve{.wall_s = {1, 3}, .heldout_psnr = {20, 30}};
  EXPECT_DOUBLE_EQ(pipeline::PsnrAt(1, curve), 20);
  EXPECT_DOUBLE_EQ(pipeline::PsnrAt(1.5, curve), 22.5);
  EXPECT_DOUBLE_EQ(pipeline::PsnrAt(3, curve), 30);
  EXPECT_TRUE(std::isnan(pipeline::PsnrAt(0.5, curve)));
  EXPECT_DOUBLE_EQ(pipeline::PsnrAt(3.5, curve), 30);
  EXPECT_TRUE(std::isnan(pipeline::PsnrAt(1, {})));
}

TEST(BenchTrain, MediansAreThoseOfTheSeeds) {
  const pipeline::Spread odd = pipeline::SpreadOf({3, kInf, 2});
  EXPECT_EQ(odd.median, 3);
  EXPECT_EQ(odd.low, 2);
  EXPECT_EQ(odd.high, kInf);
  EXPECT_EQ(pipeline::SpreadOf({4, 1}).median, 2.5);
  EXPECT_TRUE(std::isnan(pipeline::SpreadOf({4, std::nan(""), 1}).median));
}

// Seed s ends at 28 + s dB on the curve and 25 + s dB on all views.
constexpr const char* kTrain = R"(for a in "$@"; do case $a in --seed=*) s=${a#--seed=};; esac; done
[ "$s" != 9 ] || exit 9
echo '{"status": "done", "steps": 100, "train_s": 5.1, "samples_per_s": 2000000,
"peak_rss_bytes": 104857600, "versions": {"commit": "abc"}}' > $out/train/train.json
printf 'step,wall_s,cpu_s,loss,train_psnr,heldout_psnr\n1,1,2,.1,20,20\n9,3,6,.1,30,%d\n' $((28 + s)) \
  > $out/train/curve.csv
)";
constexpr const char* kEvaluate = R"(s=${out##*seed}
echo '{"status": "done", "psnr": '$((25 + s))', "ssim": 0.9}' > $out/evaluate/evaluate.json
)";

class BenchTrainStages : public testing::Test {
 protected:
  BenchTrainStages() {
    fs::create_directories(dir_ / "bin");
    for (const char* program : {"pipeline", "pipeline-bench"})
      fs::copy_file(fs::path(BINARY_DIR) / "bin" / program, dir_ / "bin" / program);
    Script("normalize", "scene", "echo '{\"status\": \"done\"}' > $out/scene/scene.json\n");
    Script("train", "train", kTrain);
    Script("evaluate", "evaluate", kEvaluate);
    WriteText(dir_ / "lego/transforms_train.json", "{}");
  }
  void Script(const std::string& stage, const std::string& folder, const std::string& body) {
    const fs::path program = dir_ / ("bin/pipeline-" + stage);
    WriteText(program,
              "#!/bin/sh\nprintf '" + stage + "' >> " + (dir_ / "log").string() +
                  "\nprintf ' %s' \"$@\" >> " + (dir_ / "log").string() + "\necho >> " +
                  (dir_ / "log").string() + "\nout=$2; mkdir -p $out/" + folder + "\n" + body);
    fs::permissions(program, fs::perms::owner_all);
  }
  int Bench(std::vector<std::string> arguments) {
    fs::remove(dir_ / "log");
    arguments.insert(arguments.begin(), {(dir_ / "bin/pipeline").string(), "bench", "train"});
    return io::RunProcess(arguments, {.timeout_s = 60, .log_path = dir_ / "output"}).exit_code;
  }
  // Within this process: no stage is to be started, and a process per case takes its time.
  void ExpectUsageError(const std::vector<std::string>& arguments, const std::string& part) {
    std::vector<const char*> argv = {"bench", "train"};
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    testing::internal::CaptureStderr();
    const int code = pipeline::RunBench(static_cast<int>(argv.size()), argv.data());
    const std::string message = testing::internal::GetCapturedStderr();
    EXPECT_EQ(code, static_cast<int>(ExitCode::kUsage)) << message;
    EXPECT_NE(message.find(part), std::string::npos) << message;
  }
  std::string Log() const { return ReadText(dir_ / "log"); }
  std::string Output() const { return ReadText(dir_ / "output"); }
  std::string Lego() const { return (dir_ / "lego").string(); }
  std::string Out() const { return (dir_ / "out").string(); }

  TempDir dir_;
};

TEST_F(BenchTrainStages, EveryBudgetAndSeedIsTrainedOnOneScene) {
  ASSERT_EQ(Bench({"--out",
                   Out(),
                   "--poses",
                   Lego(),
                   "--image-size",
                   "400",
                   "--times",
                   "5s,1m",
                   "--seeds",
                   "1,2",
                   "--every=8",
                   "--precision",
                   "fp32",
                   "--threads=1"}),
            0)
      << Output();
  std::string want = "normalize --out " + Out() + "/normalized --poses " + Lego() +
                     " --holdout=every --image-size=400 --threads=1\n";
  for (const std::string time : {"5s", "1m"}) {
    for (const std::string seed : {"1", "2"}) {
      const std::string out = " --out " + Out() + "/runs/" + time + "_seed" + seed + " --threads=1";
      want += "train" + out + " --time=" + time + " --seed=" + seed + " --precision=fp32\n";
      want += "evaluate" + out + " --every=8 --no-error-budget\n";
      EXPECT_TRUE(fs::is_regular_file(dir_ / "out/runs" / (time + "_seed" + seed) / "scene/scene.json"));
    }
  }
  EXPECT_EQ(Log(), want);
  EXPECT_NE(Output().find("26.50 (26.00 to 27.00)"), std::string::npos) << Output();
  EXPECT_NE(Output().find("kept from commit abc; --force"), std::string::npos);

  const std::string csv = ReadText(dir_ / "out/train_results.csv");
  EXPECT_TRUE(csv.starts_with("machine,commit,what,parameters,metric,unit,value\n"));
  const std::string settings = " every=8 image-size=400 threads=1 precision=fp32";
  const auto has = [&](const std::string& line) { return csv.find("," + Lego() + "," + line + "\n"); };
  EXPECT_NE(has("time=5s holdout=every seed=2" + settings + " trained_by=abc,psnr,dB,27"), std::string::npos)
      << csv;
  EXPECT_NE(has("time=5s holdout=every seed=2" + settings + " trained_by=abc,wall_to_25.65dB,s,2.13"),
            std::string::npos);
  EXPECT_NE(has("time=5s holdout=every seed=2" + settings + " trained_by=abc,cpu_to_25.65dB,s,4.26"),
            std::string::npos);
  EXPECT_NE(has("time=1m holdout=every seeds=2" + settings + ",psnr_median,dB,26.5"), std::string::npos);
  EXPECT_NE(has("time=1m holdout=every seeds=2" + settings + ",wall_to_30dB_min,s,3"), std::string::npos);
  EXPECT_NE(has("time=1m holdout=every seeds=2" + settings + ",wall_to_35dB_median,s,inf"),
            std::string::npos);
  const std::string svg = ReadText(dir_ / "out/psnr_over_time.svg");
  EXPECT_NE(svg.find(">1m</text>"), std::string::npos) << svg;
  EXPECT_NE(svg.find("series-1"), std::string::npos);

  // Again, with the scene of a run folder.
  ASSERT_EQ(Bench({"--out", Out(), "--run", Out() + "/normalized", "--times=5s", "--seeds=1", "--force"}), 0);
  EXPECT_EQ(Log(),
            "train --out " + Out() + "/runs/5s_seed1 --force=true --time=5s --seed=1\nevaluate --out " +
                Out() + "/runs/5s_seed1 --force=true --every=1 --no-error-budget\n");
}

TEST_F(BenchTrainStages, BothSplitsOfACaptureAreReported) {
  ASSERT_EQ(Bench({"--out", Out(), "--poses", Lego(), "--times=5s", "--seeds=1", "--holdouts=every,sector"}),
            0)
      << Output();
  std::string want;
  for (const std::string split : {"every", "sector"}) {
    const std::string suffix = split == "sector" ? "_sector" : "";
    want += "normalize --out " + Out() + "/normalized" + suffix + " --poses " + Lego() +
            " --holdout=" + split + "\ntrain --out " + Out() + "/runs/5s" + suffix +
            "_seed1 --time=5s --seed=1\nevaluate --out " + Out() + "/runs/5s" + suffix +
            "_seed1 --every=1 --no-error-budget\n";
  }
  EXPECT_EQ(Log(), want);
  EXPECT_NE(Output().find("5s sector "), std::string::npos) << Output();
  const std::string csv = ReadText(dir_ / "out/train_results.csv");
  EXPECT_NE(csv.find("time=5s holdout=sector seed=1"), std::string::npos) << csv;
  ExpectUsageError({"--out", Out(), "--run", Out(), "--holdouts=sector"}, "--holdouts: the scene of --run");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--holdouts=half"}, "'half' is no split");
}

TEST_F(BenchTrainStages, AStageThatFailsEndsTheBenchWithItsCode) {
  EXPECT_EQ(Bench({"--out", Out(), "--poses", Lego(), "--times", "5s", "--seeds", "1,9,2"}),
            static_cast<int>(ExitCode::kNumeric));
  EXPECT_NE(Output().find("pipeline train failed. The same command continues"), std::string::npos)
      << Output();
  EXPECT_EQ(Log().find("seed=2"), std::string::npos);
  Script("evaluate", "evaluate", "");
  EXPECT_EQ(Bench({"--out", Out(), "--poses", Lego(), "--times", "6s"}),
            static_cast<int>(ExitCode::kBadState));
  EXPECT_NE(Output().find("has no valid record of `evaluate`"), std::string::npos) << Output();
}

TEST_F(BenchTrainStages, OptionsAreCheckedBeforeTheFirstRun) {
  EXPECT_EQ(Bench({"--help"}), 0);
  EXPECT_NE(Output().find("--precision"), std::string::npos);
  ExpectUsageError({"--poses", Lego()}, "--out DIR is missing");
  ExpectUsageError({"--out", Out()}, "Give either --poses SCENE or --run RUNFOLDER");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--run", Out()}, "needs one scene");
  ExpectUsageError({"--out", Out(), "--run", Out(), "--image-size=40"}, "--image-size: the scene of --run");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--time=5s"}, "Give --times");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--seed=5"}, "Give --seeds");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--steps=5"}, "budgets are times");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--times=5x"}, "--times: '5x' is not a duration");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--times=0"}, "--times: '0'");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--seeds=,"}, "must not be empty");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--precision=fp8"}, "--precision: 'fp8'");
  ExpectUsageError({"--out", Out(), "--poses", Lego(), "--precison=fp32"}, "Did you mean --precision?");
  EXPECT_EQ(Bench({"--out", Out(), "--run", Lego()}), static_cast<int>(ExitCode::kBadInput));
  EXPECT_NE(Output().find("has no normalised scene"), std::string::npos);
  WriteText(dir_ / "photos/a.txt", "");
  EXPECT_EQ(Bench({"--out", Out(), "--poses", (dir_ / "photos").string()}),
            static_cast<int>(ExitCode::kBadInput));
  EXPECT_NE(Output().find("has no poses"), std::string::npos);
  WriteText(dir_ / "out/train_results.csv", "a,b\n");
  ExpectUsageError({"--out", Out(), "--poses", Lego()}, "was written by another benchmark");
}

}  // namespace
