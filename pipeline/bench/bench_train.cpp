// `pipeline bench train`: normalises once, then trains and evaluates for every budget and seed, with the
// programs of the stages.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "io/process/interrupt.h"
#include "io/process/process.h"
#include "pipeline/bench/bench.h"
#include "pipeline/bench/bench_table.h"
#include "pipeline/bench/bench_train_tables.h"
#include "pipeline/ingest/run_input.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/run_record.h"
#include "pipeline/stage/stage_table.h"
#include "pipeline/stages/train_options.h"
#include "pipeline/stages/train_preset.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
namespace fs = std::filesystem;

// Stages promise to stop within 2 s.
constexpr double kStageGrace_s = 6;

struct TrainBench {
  CommonOptions common;
  fs::path poses, run;
  int image_size = 0, every = 1;
  bool has_image_size = false;
  std::vector<std::string> times, holdouts;
  std::vector<int> seeds;
  std::vector<std::string> common_flags, train_flags;  // passed on
};

void RunStageProgram(const std::string& stage, const std::vector<std::string>& arguments) {
  std::vector<std::string> argv = {ProgramOf(stage).string()};
  argv.insert(argv.end(), arguments.begin(), arguments.end());
  const io::ProcessReport report = io::RunProcess(argv, {.grace_s = kStageGrace_s});
  io::ThrowIfInterrupted();
  if (report.Ok()) return;
  // The stage has said why, under the same exit codes.
  const bool has_code = report.signal == 0 && report.exit_code > 0 && report.exit_code < 128;
  throw Error(
      has_code ? static_cast<ExitCode>(report.exit_code) : ExitCode::kNoResources,
      fmt::format(
          "pipeline {} failed{}", stage, report.signal ? fmt::format(" by signal {}", report.signal) : ""),
      "The same command continues with the runs that are left");
}

// Of the names of folders.
std::string Suffix(const std::string& holdout) { return holdout == "sector" ? "_sector" : ""; }

// The run folder whose scene/ all runs of a split share: the user's own, or one made here.
fs::path PrepareScene(const TrainBench& bench, const std::string& holdout) {
  if (!bench.run.empty()) {
    if (ReadStageRecord(bench.run, "normalize").empty()) {
      throw Error(ExitCode::kBadInput,
                  bench.run.string() + ": has no normalised scene",
                  "Run pipeline normalize --out " + bench.run.string() + ", or give --poses");
    }
    return bench.run;
  }
  const RunInput input = ExamineInput(bench.poses);
  if (input.poses.empty()) {
    throw Error(ExitCode::kBadInput,
                bench.poses.string() + ": has no poses",
                "Give a transforms.json, its folder or a COLMAP model, or run `pipeline run` and give --run");
  }
  const fs::path folder = bench.common.out / ("normalized" + Suffix(holdout));
  std::vector<std::string> arguments = {
      "--out", folder.string(), "--poses", input.poses.string(), "--holdout=" + holdout};
  if (!input.images.empty()) arguments.insert(arguments.end(), {"--images", input.images.string()});
  if (bench.has_image_size) arguments.push_back(fmt::format("--image-size={}", bench.image_size));
  arguments.insert(arguments.end(), bench.common_flags.begin(), bench.common_flags.end());
  RunStageProgram("normalize", arguments);
  return folder;
}

// A run folder of its own, whose scene is the shared one.
fs::path PrepareRunFolder(const fs::path& folder, const fs::path& scene_run) {
  const fs::path link = folder / "scene", target = fs::absolute(scene_run) / "scene";
  io::ClaimFolder(folder);
  if (fs::is_symlink(link)) fs::remove(link);
  fs::create_directory_symlink(target, link);
  return folder;
}

TrainingResult RunOnce(const TrainBench& bench,
                       const std::string& time,
                       const std::string& holdout,
                       int seed,
                       const fs::path& scene_run) {
  const std::string name = fmt::format("{}{}_seed{}", time, Suffix(holdout), seed);
  const fs::path folder = PrepareRunFolder(bench.common.out / "runs" / name, scene_run);
  std::fprintf(stderr, "bench train: %s, seed %d, in %s\n", time.c_str(), seed, folder.c_str());
  std::vector<std::string> arguments = {"--out", folder.string()};
  arguments.insert(arguments.end(), bench.common_flags.begin(), bench.common_flags.end());
  std::vector<std::string> train = arguments;
  train.insert(train.end(), {"--time=" + time, fmt::format("--seed={}", seed)});
  train.insert(train.end(), bench.train_flags.begin(), bench.train_flags.end());
  RunStageProgram("train", train);
  arguments.push_back(fmt::format("--every={}", bench.every));
  arguments.push_back("--no-error-budget");
  RunStageProgram("evaluate", arguments);

  TrainingResult result{.time = time, .holdout = holdout, .seed = seed};
  ReadTrainingResult(folder, &result);
  if (result.commit != BenchCommit()) {
    std::fprintf(stderr,
                 "bench train: this run is kept from commit %s; --force runs it again\n",
                 result.commit.c_str());
  }
  return result;
}

void RunTrainBench(const TrainBench& bench) {
  const fs::path csv = bench.common.out / "train_results.csv";
  CheckTableIsOurs(csv, kBenchTableHeader);
  io::ClaimFolder(bench.common.out);
  std::vector<BudgetResults> budgets;
  for (const std::string& holdout : bench.holdouts) {
    const fs::path scene_run = PrepareScene(bench, holdout);
    for (const std::string& time : bench.times) {
      BudgetResults& runs = budgets.emplace_back();
      for (const int seed : bench.seeds) runs.push_back(RunOnce(bench, time, holdout, seed, scene_run));
    }
  }
  std::string settings = fmt::format(" every={}", bench.every);
  if (bench.has_image_size) settings += fmt::format(" image-size={}", bench.image_size);
  for (const std::string& flag : bench.common_flags) {
    if (flag != "--force=true") settings += " " + flag.substr(2);
  }
  for (const std::string& flag : bench.train_flags) settings += " " + flag.substr(2);
  std::printf("%s\n", BenchMachine().c_str());
  PrintTraining(budgets);
  WriteTrainingTable(csv, budgets, (bench.run.empty() ? bench.poses : bench.run).string(), settings);
  WriteTrainingPlot(bench.common.out / "psnr_over_time.svg", budgets);
}

void Require(bool holds, const std::string& what, const std::string& remedy) {
  if (!holds) throw Error(ExitCode::kUsage, what, remedy);
}

// Sorts the options into those of the bench, of all stages and of `train`, and checks all of them before the
// first run.
void Resolve(const Options& options,
             const TrainFlags& flags,
             const std::string& times,
             const std::string& seeds,
             const std::string& holdouts,
             TrainBench* bench) {
  Require(bench->poses.empty() != bench->run.empty(),
          "pipeline bench train: needs one scene",
          "Give either --poses SCENE or --run RUNFOLDER");
  bench->has_image_size = options.IsSetByUser("image-size");
  Require(bench->run.empty() || !bench->has_image_size,
          "--image-size: the scene of --run has its size",
          "Give --poses instead");
  Require(bench->run.empty() || !options.IsSetByUser("holdouts"),
          "--holdouts: the scene of --run has its split",
          "Give --poses instead");
  Require(!options.IsSetByUser("time"), "--time: several budgets are measured", "Give --times");
  Require(!options.IsSetByUser("target"), "--target: several budgets are measured", "Give --times");
  Require(!options.IsSetByUser("seed"), "--seed: several seeds are measured", "Give --seeds");
  Require(!options.IsSetByUser("steps"), "--steps: budgets are times here", "Give --times");
  ResolvedTrainOptions(options, flags);
  bench->times = SplitList(times);
  for (const std::string& time : bench->times) ParseDuration("times", time);
  bench->holdouts = SplitList(holdouts);
  for (const std::string& holdout : bench->holdouts) {
    Require(holdout == "every" || holdout == "sector",
            "--holdouts: '" + holdout + "' is no split",
            "Give every, sector, or every,sector");
  }
  bench->seeds = SplitIntegers("seeds", seeds, 0);
  Require(!bench->times.empty() && !bench->seeds.empty() && !bench->holdouts.empty(),
          "--times, --seeds and --holdouts: must not be empty",
          "");
  const std::vector<std::string> own = {
      "out", "poses", "run", "image-size", "every", "times", "seeds", "holdouts"};
  for (const std::string& name : options.NamesSetByUser()) {
    if (std::find(own.begin(), own.end(), name) != own.end()) continue;
    const bool is_common = name == "threads" || name == "force";
    (is_common ? bench->common_flags : bench->train_flags)
        .push_back("--" + name + "=" + options.ValueText(name));
  }
}

}  // namespace

int RunBenchTrain(int argc, const char* const* argv) {
  return GuardedMain("pipeline bench train", [&] {
    TrainBench bench;
    TrainFlags flags;
    std::string times = "5s,15s,1m,3m,10m", seeds = "1,2,3", holdouts = "every";
    Options options(
        "pipeline bench train",
        "Trains a scene for every budget and seed with the programs of the stages, and states the quality\n"
        "of all held-out views in the end, and from the run's curve the time to several qualities on 8192\n"
        "fixed held-out pixels. Training time counts from the start of reading the pictures, without\n"
        "monitoring, checkpoints and evaluation. Writes train_results.csv, psnr_over_time.svg and a run\n"
        "folder per run under runs/. Runs that are there already are kept; --force runs them again.\n"
        "The options of `pipeline train` are passed on.");
    options.Add(
        "out", &bench.common.out, "folder for the tables, the plot and the runs", {.required = "DIR"});
    options.Add("threads",
                &bench.common.threads,
                "worker threads; 0 = all cores; kept runs stay as they are",
                {.min = 0});
    options.Add("force", &bench.common.force, "run again even when nothing changed");
    options.Add("poses", &bench.poses, "scene with poses: transforms.json, its folder, or a COLMAP model");
    options.Add("run", &bench.run, "run folder whose normalised scene is used instead");
    options.Add(
        "image-size",
        &bench.image_size,
        "with --poses: longest side for training, pixels, 0 = keep; if not given, as `normalize` does",
        {.min = 0});
    options.Add("times", &times, "training budgets");
    options.Add("seeds", &seeds, "seeds; medians and ranges are over them");
    options.Add("holdouts",
                &holdouts,
                "with --poses of a capture: test views, every (every 8th), sector (one side), or both");
    options.Add("every", &bench.every, "score every n-th held-out view only; 1 = all", {.min = 1});
    AddTrainOptions(&options, &flags);
    if (!options.Parse(argc, argv)) return;
    ApplyPreset(argc, argv, &options, &flags);
    Resolve(options, flags, times, seeds, holdouts, &bench);
    RunTrainBench(bench);
  });
}

}  // namespace pipeline
