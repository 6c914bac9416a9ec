#include "pipeline/stages/rank_session.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>

#include "io/base/error.h"
#include "io/process/meeting.h"
#include "nerf/kernels/kernels.h"
#include "pipeline/stages/program_change.h"
#include "pipeline/stages/run_secret.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;

constexpr int kMaxRanks = 1024, kMaxPort = 65535, kMaxWaitS = 1 << 20;
// Set by `pipeline run` for its stages, whose ranks then meet in the store that it keeps.
constexpr const char* kRunStore = "PIPELINE_RUN_STORE";
constexpr const char* kRemedy = "torchrun sets it; samples/slurm.sh shows how with srun";
// From the slowest on. Each computes in its own order: ranks must all use the same.
constexpr const char* kKernels[] = {"portable", "avx2", "avx512", "avx512bf16"};

std::string Variable(const char* name) {
  const char* value = std::getenv(name);
  if (!value || !*value) throw Error(ExitCode::kUsage, std::string(name) + " is not set", kRemedy);
  return value;
}

int NumberOf(const char* name, int low, int high) {
  const std::string text = Variable(name);
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < low || value > high) {
    throw Error(ExitCode::kUsage,
                fmt::format("{}={}: no whole number from {} to {}", name, text, low, high),
                kRemedy);
  }
  return value;
}

bool IsSet(const char* name) {
  const char* value = std::getenv(name);
  return value && *value;
}

io::Meeting MeetingOf(const std::string& stage, const std::filesystem::path& out, int size) {
  io::Meeting meeting{.rank = NumberOf("RANK", 0, size - 1), .size = size};
  meeting.address = Variable("MASTER_ADDR");
  // torchrun keeps a store of its own at that port, in the language of its version.
  const int beside = IsSet("TORCHELASTIC_USE_AGENT_STORE") ? 1 : 0;
  meeting.port = static_cast<std::uint16_t>(NumberOf("MASTER_PORT", 1, kMaxPort - 1) + beside);
  meeting.has_store = IsSet(kRunStore);
  if (IsSet("PIPELINE_JOIN_S"))
    meeting.patience = std::chrono::seconds(NumberOf("PIPELINE_JOIN_S", 1, kMaxWaitS));
  // A store that outlives a stage must not show it what an earlier one left.
  const std::string attempt =
      IsSet("TORCHELASTIC_RESTART_COUNT") ? Variable("TORCHELASTIC_RESTART_COUNT") : "0";
  meeting.secret =
      fmt::format("{}/{}/{}", RunSecret(out, meeting.rank == 0, meeting.patience), stage, attempt);
  return meeting;
}

std::size_t BestKernels() {
  const char* wanted = std::getenv("PIPELINE_SIMD");
  std::size_t best = 0;
  for (std::size_t i = 0; i < std::size(kKernels); ++i) {
    if (!nerf::kernels::FindKernels(kKernels[i])) continue;
    if (wanted && std::strcmp(wanted, kKernels[i]) == 0) return i;
    best = i;
  }
  return best;
}

void UseCommonKernels() {
  const std::size_t mine = BestKernels();
  std::size_t lowest = mine, highest = mine;
  for (const std::string& theirs : io::AllRanks().AllGather(std::to_string(mine))) {
    lowest = std::min(lowest, static_cast<std::size_t>(std::stoul(theirs)));
    highest = std::max(highest, static_cast<std::size_t>(std::stoul(theirs)));
  }
  setenv("PIPELINE_SIMD", kKernels[lowest], 1);
  if (!io::AllRanks().IsFirst()) return;
  std::fprintf(stderr,
               "pipeline: %d ranks with %s kernels%s\n",
               io::AllRanks().size(),
               kKernels[lowest],
               lowest < highest ? ", the best that all of them have" : "");
}

}  // namespace

RankSession::RankSession(const std::string& stage,
                         const std::filesystem::path& out,
                         int argc,
                         const char* const* argv)
    : exceptions_(std::uncaught_exceptions()) {
  const int size = IsSet("WORLD_SIZE") ? NumberOf("WORLD_SIZE", 1, kMaxRanks) : 1;
  if (size == 1) return;
  if (!io::Join()) ContinueIn("pipeline-ranks", stage, argc, argv);
  before_ = io::UseRanks(io::Join()(MeetingOf(stage, out, size)));
  UseCommonKernels();
  if (stage == "run") setenv(kRunStore, "1", 1);
}

RankSession::~RankSession() {
  if (!before_) return;
  if (std::uncaught_exceptions() == exceptions_) io::AllRanks().Leave();
  io::UseRanks(std::move(before_));
}

}  // namespace pipeline
