// `pipeline doctor`: what this computer offers, what is missing, and how to get it.
#include <fmt/format.h>

#include <cstdlib>
#include <utility>

#include "io/base/error.h"
#include "nerf/kernels/kernels.h"
#include "pipeline/command/commands.h"
#include "pipeline/machine/machine.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_table.h"

namespace pipeline {
namespace {

// ATLAS and the reference BLAS stay below it on any CPU with AVX2; OpenBLAS is above it on one core.
constexpr double kSlowSgemmGflops = 60;

template <typename... Values>
void Row(const char* name, fmt::format_string<Values...> format, Values&&... values) {
  fmt::print("{:<9}", name);
  fmt::print(format, std::forward<Values>(values)...);
  fmt::print("\n");
}

// Prints the program's row; true when it can serve.
bool Report(const char* name, const Program& program, const char* package) {
  if (program.fault.empty()) {
    Row(name, "{} ({})", program.version, program.path.string());
    return true;
  }
  Row(name, "{} {}: apt install {}", program.path.string(), program.fault, package);
  return false;
}

}  // namespace

int RunDoctor(int argc, const char* const* argv) {
  return GuardedMain("pipeline doctor", [&] {
    std::filesystem::path out = ".";
    Options options("pipeline doctor",
                    "Checks processor, memory, disk, linear algebra and external programs.");
    options.Add("out", &out, "folder whose disk is checked", {.affects_result = false});
    if (!options.Parse(argc, argv)) return;

    const Machine machine = DescribeMachine();
    Row("CPU", "{}, {} cores", machine.cpu, machine.cores);
    Row("SIMD",
        "{} kernels{}, bfloat16 {}",
        machine.kernels,
        std::getenv("PIPELINE_SIMD") ? " (PIPELINE_SIMD is set)" : "",
        machine.has_bf16 ? "in hardware" : "widened to float, which costs time");
    Row("memory", "{:.1f} GiB, {:.1f} free", machine.memory_gib, machine.memory_available_gib);
    std::error_code error;
    const auto space = std::filesystem::space(out, error);
    if (error) throw io::Error(io::ExitCode::kBadInput, out.string() + ": " + error.message());
    Row("disk", "{:.1f} GiB free", static_cast<double>(space.available) / (1 << 30));
    const double gflops = MeasureSgemmGflops();
    Row("BLAS",
        "{} with {} kernels, {} threads, sgemm {:.0f} GFLOP/s",
        machine.blas,
        machine.blas_kernels,
        machine.blas_threads,
        gflops);
    if (nerf::kernels::FindKernels("avx512") &&
        (machine.blas_kernels == "Haswell" || machine.blas_kernels == "Zen"))
      Row("", "these kernels leave AVX-512 unused: export OPENBLAS_CORETYPE=SKYLAKEX");
    if (gflops < kSlowSgemmGflops && nerf::kernels::FindKernels("avx2"))
      Row("", "slow for this CPU: close other programs, or apt install libopenblas-openmp-dev");

    const bool has_colmap = Report("COLMAP", FindColmap(), "colmap");
    const bool has_ffmpeg = Report("ffmpeg", FindFfmpeg(), "ffmpeg");
    Report("LibTorch", FindTorch(), "libtorch-dev");                           // only --field nerf needs it
    Report("export", FindExporter(), "libmeshoptimizer-dev libtinygltf-dev");  // and build all targets
    for (const StageEntry& stage : StageTable()) ProgramOf(stage.name);
    if (!has_colmap || !has_ffmpeg) {
      const std::string missing = has_colmap ? "ffmpeg" : has_ffmpeg ? "COLMAP" : "COLMAP and ffmpeg";
      throw io::Error(io::ExitCode::kMissingTool, missing + " cannot be used", "Install as shown above");
    }
    fmt::print("all that is needed is here\n");
  });
}

}  // namespace pipeline
