// `pipeline`: starts the program of a stage or command, as git does.
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "io/base/error.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_table.h"
#include "pipeline/stage/versions.h"

namespace {

struct Command {
  const char* name;
  const char* help;
};
constexpr Command kCommands[] = {
    {"run", "all stages: from pictures, a video or known poses to film and report"},
    {"view", "look around in a run in the browser, also while it trains"},
    {"export", "write cameras, points, depth maps and splats of a run for other programs"},
    {"doctor", "check this computer: processor, BLAS, memory, disk, COLMAP, ffmpeg, exports"},
    {"bench", "measure speed against error: bench sfm, bench kernels, bench train"},
};

void PrintHelp() {
  std::printf(
      "usage: pipeline COMMAND [options]\n\n"
      "Turns photos or a video of a still scene into a trained radiance field (NeRF), its measured\n"
      "quality on views it has not seen, and a film from new viewpoints. Needs no GPU.\n\n"
      "  pipeline doctor          is everything here that is needed?\n"
      "  pipeline run photos/     film and report appear in photos.run/\n\n"
      "commands\n");
  for (const Command& command : kCommands) std::printf("  %-10s %s\n", command.name, command.help);
  std::printf(
      "\nstages, in the order in which `run` chains them; each works on one run folder (--out DIR)\n");
  for (const pipeline::StageEntry& stage : pipeline::StageTable())
    std::printf("  %-10s %s\n  %-10s   %s -> %s\n", stage.name, stage.help, "", stage.inputs, stage.outputs);
  std::printf(
      "\n`pipeline COMMAND --help` explains its options.\n\n"
      "exit codes\n"
      "  0 done    2 usage    3 bad input    4 the capture cannot be reconstructed\n"
      "  5 a program or CPU feature is missing    6 disk or memory    7 run folder in use\n"
      "  8 damaged checkpoint or model    9 numerical failure    11 another rank was lost\n"
      "  70 a bug    128+n signal n\n");
}

// Replaces this process by `pipeline-<name>`; returns only by throwing.
void Exec(const std::string& name, char** argv) {
  const std::string program = pipeline::ProgramOf(name).string();
  argv[0] = const_cast<char*>(program.c_str());
  execv(program.c_str(), argv);
  throw io::Error(io::ExitCode::kMissingTool, program + ": " + std::strerror(errno));
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "";
  if (name.empty() || name == "--help" || name == "-h" || name == "help") {
    PrintHelp();
    return static_cast<int>(name.empty() ? io::ExitCode::kUsage : io::ExitCode::kOk);
  }
  if (name == "--version") {
    std::printf("%s\n", io::DumpJson(pipeline::VersionsJson()).c_str());
    return 0;
  }
  std::vector<std::string> names;
  for (const Command& command : kCommands) names.push_back(command.name);
  for (const pipeline::StageEntry& stage : pipeline::StageTable()) names.push_back(stage.name);
  return pipeline::GuardedMain("pipeline", [&] {
    for (const std::string& known : names) {
      if (name == known) Exec(name, argv + 1);
    }
    throw io::Error(io::ExitCode::kUsage,
                    "unknown command '" + name + "'",
                    "Did you mean " + pipeline::NearestName(name, names) + "? See pipeline --help");
  });
}
