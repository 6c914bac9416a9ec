// What the machine can do at most, as cases: the yardsticks of `pipeline bench kernels`.
#include <fmt/format.h>

#include <memory>

#include "io/base/random.h"
#include "nerf/kernels/limits.h"
#include "pipeline/bench/kernel_cases.h"

namespace pipeline {
namespace {

namespace kernels = nerf::kernels;

KernelCase ArithmeticCase(const std::string& build,
                          const char* format,
                          double (*probe)(int, float*),
                          KernelData* data) {
  constexpr int kRounds = 20000;
  KernelCase c{.build = build, .kernel = kArithmetic, .format = format, .item = "operation"};
  c.unit = "GFLOP/s";
  c.items = c.work = kRounds * probe(1, data->sums.data());
  c.run = [probe, data] { probe(kRounds, data->sums.data()); };
  return c;
}

using Access = void(KernelData* data, std::uint32_t mask, const std::uint32_t* picks, int rounds);

// Random accesses to a table of 2^log2_entries, as many as it has entries: all of it is in use.
KernelCase AccessCase(
    const char* what, const char* format, int log2_entries, Access* access, KernelData* data) {
  const std::uint32_t entries = 1u << log2_entries;
  std::vector<std::uint32_t> picks;
  for (std::uint64_t i = 0; i < kernels::kPicks; ++i)
    picks.push_back(io::Random(6, io::Stream::kInit, 0, i).Below(entries));
  KernelCase c{.build = kAnyBuild, .kernel = what + Power(log2_entries), .format = format, .item = "access"};
  c.unit = "G accesses/s";
  c.items = c.work = entries;
  c.run = [=] { access(data, entries - 1, picks.data(), static_cast<int>(entries) / kernels::kPicks); };
  return c;
}

KernelCase StreamCase(const char* what, double mebibytes, double bytes_per_byte, std::function<void()> run) {
  const std::string size = fmt::format("{}MiB", static_cast<int>(mebibytes));
  KernelCase c{.build = kAnyBuild, .kernel = what, .format = size, .item = "byte", .unit = "GB/s"};
  c.items = c.work = mebibytes * (1 << 20) * bytes_per_byte;
  c.run = std::move(run);
  return c;
}

}  // namespace

std::vector<KernelCase> LimitCases(const std::vector<std::string>& builds, KernelData* data) {
  std::vector<KernelCase> cases;
  for (const std::string& build : builds) {
    const kernels::ArithmeticProbe* probe = kernels::FindArithmeticProbe(build.c_str());
    cases.push_back(ArithmeticCase(build, "fp32", probe->fp32, data));
    if (probe->bf16) cases.push_back(ArithmeticCase(build, "bf16", probe->bf16, data));
  }
  for (int log2 = kMinLog2Entries; log2 <= kMaxLog2Entries; ++log2) {
    const auto wide = [](KernelData* d, std::uint32_t mask, const std::uint32_t* picks, int rounds) {
      d->used = kernels::GatherEntries(d->table.data(), mask, picks, rounds);
    };
    const auto narrow = [](KernelData* d, std::uint32_t mask, const std::uint32_t* picks, int rounds) {
      d->used = kernels::GatherEntries(d->rounded.data(), mask, picks, rounds);
    };
    const auto update = [](KernelData* d, std::uint32_t mask, const std::uint32_t* picks, int rounds) {
      kernels::UpdateEntries(d->gradient.data(), mask, picks, rounds);
    };
    cases.push_back(AccessCase(kGather, "16B", log2, wide, data));
    cases.push_back(AccessCase(kGather, "8B", log2, narrow, data));
    cases.push_back(AccessCase(kUpdate, "16B", log2, update, data));
  }
  const std::size_t n_step = 4 * data->dense.size(), n_all = data->stream.size();
  const auto mebibytes = [](std::size_t n) { return static_cast<double>(n) * sizeof(float) / (1 << 20); };
  for (const std::size_t n : {n_step, n_all}) {
    cases.push_back(StreamCase(
        kStreamRead, mebibytes(n), 1, [=] { data->used = kernels::StreamRead(n, data->stream.data()); }));
  }
  cases.push_back(StreamCase(
      kStreamUpdate, mebibytes(n_step), 2, [=] { kernels::StreamUpdate(n_step, data->stream.data()); }));
  return cases;
}

}  // namespace pipeline
