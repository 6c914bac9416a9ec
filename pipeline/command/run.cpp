// `pipeline run`: chains the programs of the stages. Each stage decides itself whether it is up to date,
// resumes or starts anew; this file chooses where the chain begins, forwards options and stops at the first
// failure.
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "io/base/error.h"
#include "io/base/json.h"
#include "io/base/quoting.h"
#include "io/process/interrupt.h"
#include "io/process/process.h"
#include "io/process/progress.h"
#include "io/process/ranks.h"
#include "pipeline/command/commands.h"
#include "pipeline/evaluation/verdict.h"
#include "pipeline/ingest/ingest_options.h"
#include "pipeline/ingest/run_input.h"
#include "pipeline/machine/machine.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/folder_lock.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/run_record.h"
#include "pipeline/stage/stage_table.h"
#include "pipeline/stages/rank_session.h"
#include "pipeline/stages/stage_options.h"
#include "pipeline/stages/train_options.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using io::Json;
namespace fs = std::filesystem;

// Stages promise to stop within 2 s, and so do the programs that they started: wait for both.
constexpr double kStageGrace_s = 6;

// The flags of the stages, whose options `run` offers under the stages' own defaults, ranges and help.
struct RunOptions {
  fs::path input;
  CommonOptions common;
  IngestFlags ingest;
  sfm::ReconstructionOptions sfm;
  NormalizeFlags normalize;
  TrainFlags train;
  FilmFlags render;
  bool view = false;
};

struct Forward {
  const char* option;
  const char* stage;  // "": every stage
  const char* stage_option;
};
constexpr Forward kForwards[] = {
    {"time", "train", "time"},
    {"target", "train", "target"},
    {"field", "train", "field"},
    {"preset", "train", "preset"},
    {"masks", "ingest", "masks"},
    {"max-frames", "ingest", "max-frames"},
    {"frames", "ingest", "frames"},
    {"max-size", "ingest", "max-size"},
    {"find-overlay", "ingest", "find-overlay"},
    {"find-fisheye", "ingest", "find-fisheye"},
    {"features", "sfm", "features"},
    {"image-size", "normalize", "image-size"},
    {"holdout", "normalize", "holdout"},
    {"holdout-every", "normalize", "holdout-every"},
    {"steps", "train", "steps"},
    {"seed", "train", "seed"},
    {"refine-cameras", "train", "refine-cameras"},
    {"find-transients", "train", "find-transients"},
    {"splats", "train", "splats"},
    {"frames-out", "render", "frames"},
    {"fps", "render", "fps"},
    {"depth", "render", "depth"},
    {"support", "render", "support"},
    {"threads", "", "threads"},
    {"memory", "", "memory"},
    {"force", "", "force"},
};

void AddRunOptions(Options* options, RunOptions* run) {
  std::map<std::string, Options> stages;
  for (const char* stage : {"", "ingest", "sfm", "normalize", "train", "render"})
    stages.try_emplace(stage, "", "");
  AddCommonOptions(&stages.at(""), &run->common);
  AddIngestOptions(&stages.at("ingest"), &run->ingest);
  AddSfmOptions(&stages.at("sfm"), &run->sfm);
  AddNormalizeOptions(&stages.at("normalize"), &run->normalize);
  AddTrainOptions(&stages.at("train"), &run->train);
  AddRenderOptions(&stages.at("render"), &run->render);
  options->AddPositional(
      "INPUT", &run->input, "folder of pictures, quoted glob, video, transforms.json or COLMAP model", true);
  options->Add("out", &run->common.out, "run folder; default: <INPUT>.run", {.affects_result = false});
  options->Add("view",
               &run->view,
               "open a page to look around in what is there so far (`pipeline view`), until Ctrl-C",
               {.affects_result = false});
  for (const Forward& forward : kForwards)
    options->AddFrom(stages.at(forward.stage), forward.stage_option, forward.option, forward.stage);
}

std::vector<std::string> StageArguments(const std::string& stage,
                                        const RunInput& input,
                                        const fs::path& out,
                                        const Options& options) {
  std::vector<std::string> arguments;
  if (stage == "ingest") arguments.push_back(input.path.string());
  arguments.insert(arguments.end(), {"--out", out.string()});
  if (stage == "normalize" && !input.poses.empty()) {
    arguments.insert(arguments.end(), {"--poses", input.poses.string()});
    if (!input.images.empty()) arguments.insert(arguments.end(), {"--images", input.images.string()});
  }
  for (const Forward& forward : kForwards) {
    const bool applies = *forward.stage == 0 || stage == forward.stage;
    if (applies && options.IsSetByUser(forward.option))
      arguments.push_back(std::string("--") + forward.stage_option + "=" + options.ValueText(forward.option));
  }
  return arguments;
}

// As one would type it in a shell.
std::string CommandText(const std::string& stage, const std::vector<std::string>& arguments) {
  std::string text = "pipeline " + stage;
  for (const std::string& argument : arguments) text += " " + io::ShellWord(argument);
  return text;
}

// Returns the stage's exit code; the stage has printed its own line when it is not 0.
int RunStage(const std::string& stage, const fs::path& out, const std::vector<std::string>& arguments) {
  std::vector<std::string> argv = {ProgramOf(stage).string()};
  argv.insert(argv.end(), arguments.begin(), arguments.end());
  const io::ProcessReport report = io::RunProcess(argv, {.grace_s = kStageGrace_s});
  io::ThrowIfInterrupted();
  if (report.signal != 0) {
    std::fprintf(stderr,
                 "pipeline run: %s was ended by signal %d%s; the same command continues\n",
                 stage.c_str(),
                 report.signal,
                 report.signal == SIGKILL ? " (out of memory?)" : "");
    return 128 + report.signal;
  }
  if (report.exit_code != 0) return report.exit_code;
  if (io::AllRanks().IsFirst() && TextAt(ReadStageRecord(out, stage), "status") != "done")
    throw Error(ExitCode::kInternal, stage + " ended without its record", "Please report this as a bug");
  return 0;
}

// `pipeline view` beside the stages.
class ViewBeside {
 public:
  explicit ViewBeside(const fs::path& out)
      : thread_([this, argv = std::vector<std::string>{ProgramOf("view").string(), out.string()}] {
          try {
            io::RunProcess(argv, {.on_tick = [this] { ThrowIfEnded(); }});
          } catch (const std::exception&) {  // its end is not that of the run; it has said why
          }
          has_ended_ = true;
        }) {}
  ~ViewBeside() {
    end_ = true;
    thread_.join();
  }
  // Until Ctrl-C or until the page's program ends.
  void Wait() const {
    while (!has_ended_ && io::PendingInterrupt() == 0)
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }

 private:
  void ThrowIfEnded() const {
    if (end_) throw Error(ExitCode::kInternal, "the run ended");
  }

  std::atomic<bool> end_ = false, has_ended_ = false;
  std::thread thread_;
};

void PrintResults(const fs::path& out, const std::vector<std::string>& stages, double wall_s) {
  double total_s = 0;
  std::string times;
  for (const std::string& stage : stages) {
    const double stage_s = NumberAt(ReadStageRecord(out, stage), "wall_s");
    total_s += stage_s;
    times += (times.empty() ? "" : ", ") + stage + " " + io::FormatDuration(stage_s);
  }
  const fs::path film = out / "render/novel_view.mp4", page = out / "report.html";
  for (const fs::path& product : {film, page}) {
    if (!fs::is_regular_file(product))
      throw Error(ExitCode::kInternal, product.string() + ": was not written", "Please report this as a bug");
  }
  std::printf("time    %s (%s); this command %s\nfilm    %s\nreport  %s\n",
              io::FormatDuration(total_s).c_str(),
              times.c_str(),
              io::FormatDuration(wall_s).c_str(),
              io::Printable(film.string()).c_str(),
              io::Printable(page.string()).c_str());
}

bool IsNeeded(const std::string& stage, const RunInput& input) {
  return input.poses.empty() || (stage != "ingest" && stage != "sfm");
}

// Which stages rank 0 will run, in which way; recorded.
std::vector<std::string> PlanChain(const RunInput& input, const fs::path& out, const Options& options) {
  if (!input.poses.empty()) {
    std::fprintf(stderr,
                 "pipeline run: %s has poses: ingest and sfm are not needed\n",
                 io::Printable(input.poses.string()).c_str());
    for (const char* stage : {"ingest", "sfm"}) {
      if (!ReadStageRecord(out, stage).empty())
        throw Error(ExitCode::kUsage, out.string() + ": holds a run of pictures", "Choose another --out");
    }
  }
  std::vector<std::string> stages;
  Json commands = Json::object();
  for (const StageEntry& entry : StageTable()) {
    const std::string stage = entry.name;
    if (!IsNeeded(stage, input)) continue;
    stages.push_back(stage);
    commands[stage] = CommandText(stage, StageArguments(stage, input, out, options));
  }
  RecordRun(out,
            {{"input", input.path.string()}, {"options", options.ResolvedJson()}, {"commands", commands}});
  return stages;
}

// Runs the stage on this rank, if it has a part in it. Returns an exit code that is not 0 when that of any
// rank is not.
int RunOnAllRanks(const std::string& stage,
                  bool has_part,
                  const fs::path& out,
                  const std::vector<std::string>& arguments) {
  const int exit_code = has_part ? RunStage(stage, out, arguments) : 0;
  const std::vector<std::string> all = io::AllRanks().AllGather(std::to_string(exit_code));
  const auto failed =
      std::find_if(all.begin(), all.end(), [](const std::string& code) { return code != "0"; });
  return exit_code != 0 || failed == all.end() ? exit_code : std::stoi(*failed);
}

// What ranks do but the first: their parts of the stages that are shared out.
int FollowChain(const RunInput& input, const fs::path& out, const Options& options) {
  for (const StageEntry& entry : StageTable()) {
    const std::string stage = entry.name;
    const bool has_part = entry.is_shared && IsNeeded(stage, input);
    const int exit_code = RunOnAllRanks(stage, has_part, out, StageArguments(stage, input, out, options));
    if (exit_code != 0) return exit_code;
  }
  return 0;
}

int RunChain(const RunOptions& run, const RunInput& input, const fs::path& out, const Options& options) {
  const auto start = std::chrono::steady_clock::now();
  if (!run.ingest.masks.empty() && !input.poses.empty()) {
    throw Error(ExitCode::kUsage,
                "--masks: " + input.poses.string() + " has poses, and then the frames name their masks",
                "Write \"mask_path\" into the frames of a transforms.json");
  }
  const FolderLock lock(out, "run");
  std::fprintf(stderr, "pipeline run: %s\n", StartupLine(DescribeMachine()).c_str());
  const std::vector<std::string> stages = PlanChain(input, out, options);
  std::optional<ViewBeside> view;
  if (run.view) view.emplace(out);
  for (const StageEntry& entry : StageTable()) {
    const std::string stage = entry.name;
    const bool is_planned = std::find(stages.begin(), stages.end(), stage) != stages.end();
    const int exit_code = RunOnAllRanks(stage, is_planned, out, StageArguments(stage, input, out, options));
    if (exit_code != 0) return exit_code;
  }
  PrintResults(out, stages, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  if (view) view->Wait();
  const Verdict verdict = Judge(ReadScores(out / "evaluate"));
  if (verdict.outcome == Outcome::kFailed) {
    throw Error(ExitCode::kNotReconstructed,
                out.string() + ": not reconstructed: " + verdict.text,
                "Photograph more views between neighbouring ones, or train longer (--time)");
  }
  return 0;
}

}  // namespace

int RunRun(int argc, const char* const* argv) {
  int stage_exit_code = 0;
  const int exit_code = GuardedMain("pipeline run", [&] {
    RunOptions run;
    Options options(
        "pipeline run",
        "From pictures, a video or known poses to a film and a report. What is still valid is kept,\n"
        "what was interrupted is resumed. The stage that an option goes to is named in brackets;\n"
        "`pipeline <stage> --help` lists all options of a stage.");
    AddRunOptions(&options, &run);
    if (!options.Parse(argc, argv)) return;
    ResolvedTrainOptions(options, run.train);  // whether they go together: now, not after half an hour
    fs::path& masks = run.ingest.masks;
    if (!masks.empty()) masks = fs::absolute(masks);  // commands are repeated from anywhere
    const RunInput input = ExamineInput(run.input);
    fs::path out = run.common.out.empty() ? DefaultRunFolder(input.path) : fs::absolute(run.common.out);
    out = (out / "").lexically_normal().parent_path();
    const RankSession session("run", out, argc, argv);
    stage_exit_code =
        io::AllRanks().IsFirst() ? RunChain(run, input, out, options) : FollowChain(input, out, options);
  });
  return exit_code != 0 ? exit_code : stage_exit_code;
}

}  // namespace pipeline
