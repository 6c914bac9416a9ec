// Every option of every program that has a range, a form or a list of choices refuses what lies outside of
// it, by its name and before any work.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "io/base/error.h"
#include "pipeline/bench/bench.h"
#include "pipeline/command/commands.h"
#include "pipeline/ingest/ingest.h"
#include "pipeline/report/report.h"
#include "pipeline/stages/stages.h"

namespace {

using Program = int (*)(int argc, const char* const* argv);

struct Case {
  Program run;
  std::vector<std::string> flags;  // each alone must be refused
  std::vector<const char*> before = {};
};

TEST(OptionRanges, EveryValueOutsideIsRefusedByName) {
  const std::vector<std::string> train = {"--field=mlp",
                                          "--preset=paper",
                                          "--preset=",
                                          "--time=0s",
                                          "--time=5x",
                                          "--time=99999999999999999999",
                                          "--target=0dB",
                                          "--target=100",
                                          "--steps=-1",
                                          "--seed=-1",
                                          "--seed=2e3",
                                          "--batch=-1",
                                          "--batch=1023",
                                          "--batch=4194305",
                                          "--learning-rate=-0.1",
                                          "--learning-rate=nan",
                                          "--log2-hashmap-size=-1",
                                          "--log2-hashmap-size=25",
                                          "--finest-resolution=-1",
                                          "--finest-resolution=65537",
                                          "--grid-resolution=-64",
                                          "--grid-resolution=100",
                                          "--grid-resolution=576",
                                          "--samples=-1",
                                          "--samples=16385",
                                          "--importance-samples=-1",
                                          "--importance-samples=16385",
                                          "--rays=0",
                                          "--rays=1048577",
                                          "--learning-rate-decay=0",
                                          "--learning-rate-decay=1.1",
                                          "--learning-rate-warm-up=-1",
                                          "--position-frequencies=-1",
                                          "--position-frequencies=21",
                                          "--direction-frequencies=-1",
                                          "--direction-frequencies=21",
                                          "--encoding-space=ball",
                                          "--density=tanh",
                                          "--initialisation=zero",
                                          "--precision=fp8",
                                          "--device=tpu",
                                          "--checkpoint-every=-1"};
  const std::vector<Case> cases = {
      {pipeline::RunIngest,
       {"--threads=-1",
        "--max-size=63",
        "--max-frames=2",
        "--frames=",
        "--frames=9:3",
        "--frames=x",
        "--masks=",
        "--blur=-0.1",
        "--blur=1"},
       {"photos"}},
      {pipeline::RunSfm,
       {"--threads=-1",
        "--features=99",
        "--features=16385",
        "--detect-size=-1",
        "--detector=surf",
        "--camera-model=FISHEYE",
        "--matching=all",
        "--retry-minutes=-1"}},
      {pipeline::RunNormalize, {"--threads=-1", "--image-size=-1", "--holdout-every=1", "--poses="}},
      {pipeline::RunTrain, train},
      {pipeline::RunTrain, {"--threads=-1"}},
      {pipeline::RunEvaluate, {"--threads=-1", "--every=0", "--max-strips=-1"}},
      {pipeline::RunRender,
       {"--threads=-1",
        "--frames=1",
        "--frames=216001",
        "--fps=-1",
        "--fps=0.9",
        "--fps=240.1",
        "--fps=1e20",
        "--size=-1",
        "--size=7681",
        "--pixel-rays=2",
        "--pixel-rays=25"}},
      {pipeline::RunReport, {"--threads=-1", "--out="}},
      {pipeline::RunRun,
       {"--threads=-1",
        "--max-size=63",
        "--max-frames=2",
        "--frames=",
        "--frames=9:3",
        "--masks=",
        "--features=99",
        "--image-size=-1",
        "--holdout-every=1",
        "--field=mlp",
        "--preset=",
        "--preset=paper",
        "--time=99999999999999999999",
        "--target=100",
        "--steps=-1",
        "--seed=-1",
        "--frames-out=-1",
        "--frames-out=1",
        "--fps=-1",
        "--fps=1e20"},
       {"photos"}},
      {pipeline::RunBench, {"--threads=-1", "--seeds=0"}, {"sfm"}},
      {pipeline::RunBench, {"--rounds=0"}, {"kernels"}},
      {pipeline::RunBench, {"--threads=-1", "--image-size=-1", "--every=0"}, {"train"}},
      {pipeline::RunBench, train, {"train"}},
  };
  for (const Case& c : cases) {
    for (const std::string& flag : c.flags) {
      std::vector<const char*> argv = {"pipeline"};
      argv.insert(argv.end(), c.before.begin(), c.before.end());
      // Where a folder is demanded, this is no reason to refuse.
      if (!flag.starts_with("--out")) argv.push_back("--out=/dev/null/none");
      if (c.before == std::vector<const char*>{"train"}) argv.push_back("--poses=none");
      argv.push_back(flag.c_str());
      testing::internal::CaptureStderr();
      const int code = c.run(static_cast<int>(argv.size()), argv.data());
      const std::string message = testing::internal::GetCapturedStderr();
      EXPECT_EQ(code, static_cast<int>(io::ExitCode::kUsage)) << flag << "\n" << message;
      EXPECT_NE(message.find(flag.substr(0, flag.find('=')) + ": "), std::string::npos) << flag << "\n"
                                                                                        << message;
    }
  }
}

}  // namespace
