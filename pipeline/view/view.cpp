#include "pipeline/view/view.h"

#include <chrono>
#include <cstdio>
#include <thread>

#include "io/base/quoting.h"
#include "io/process/interrupt.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/view/view_server.h"

namespace pipeline {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(100);

struct ViewOptions {
  std::filesystem::path run;
  ServerAddress address;
  CommonOptions common;
  double training_share = 0.2;
};

void AddViewOptions(Options* options, ViewOptions* view) {
  options->AddPositional("RUN", &view->run, "run folder, finished or at work", true);
  options->Add("host",
               &view->address.host,
               "address to listen at; others than this computer can reach it only at an address of the "
               "network, and the connection is not encrypted",
               {.affects_result = false});
  options->Add("port",
               &view->address.port,
               "port; 0 = any that is free",
               {.min = 0, .max = 65535, .affects_result = false});
  options->Add("training-share",
               &view->training_share,
               "roughly the share of its time that a training gives up while somebody looks",
               {.max = 1, .above = 0, .affects_result = false});
  options->Add("threads",
               &view->common.threads,
               "processor cores to use; 0 = all",
               {.min = 0, .affects_result = false});
}

void View(const ViewOptions& view) {
  const int threads = ResolvedThreads(view.common);
  std::filesystem::path folder = std::filesystem::absolute(view.run / "").lexically_normal().parent_path();
  LiveRun run(folder, threads);
  FrameMaker maker(threads, view.training_share);
  const ViewServer server(&run, &maker, view.address);
  std::printf("view    %s\n", io::Printable(server.Url()).c_str());
  std::printf("Open it in a browser; Ctrl-C ends it.\n");
  std::fflush(stdout);
  while (io::PendingInterrupt() == 0) std::this_thread::sleep_for(kPoll);
}

}  // namespace

int RunView(int argc, const char* const* argv) {
  return GuardedMain("pipeline view", [&] {
    ViewOptions view;
    Options options("pipeline view",
                    "Opens a page to look around in a run, by mouse, touch or keys, also while it trains.");
    AddViewOptions(&options, &view);
    if (options.Parse(argc, argv)) View(view);
  });
}

}  // namespace pipeline
