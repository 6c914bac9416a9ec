#include "pipeline/machine/machine.h"

#include <cblas.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <regex>
#include <sstream>
#include <vector>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/process/parallel.h"
#include "io/process/process.h"
#include "nerf/kernels/kernels.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

constexpr double kProbeTimeout_s = 20;  // a program that prints its version needs far less

// "model name : AMD EPYC" -> "AMD EPYC"; empty when no line of the file starts with the key.
std::string ProcValue(const char* file, const std::string& key) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    const std::size_t colon = line.find(':');
    if (line.rfind(key, 0) == 0 && colon != std::string::npos)
      return line.substr(std::min(line.size(), line.find_first_not_of(" \t", colon + 1)));
  }
  return "";
}

double MemoryGib(const std::string& key) {
  double kib = 0;
  std::istringstream(ProcValue("/proc/meminfo", key)) >> kib;
  return kib / (1 << 20);
}

std::string OutputOf(const std::vector<std::string>& argv) { return io::OutputOf(argv, kProbeTimeout_s); }

std::string FirstMatch(const std::string& text, const char* pattern) {
  std::smatch match;
  return std::regex_search(text, match, std::regex(pattern)) ? match[1].str() : "";
}

Program ProgramBeside(const char* name) {
  Program program;
  program.path = fs::read_symlink("/proc/self/exe").parent_path() / name;
  if (access(program.path.c_str(), X_OK) != 0) program.fault = "is missing";
  return program;
}

}  // namespace

Machine DescribeMachine() {
  Machine machine;
  machine.cpu = ProcValue("/proc/cpuinfo", "model name");
  machine.cores = io::AvailableCores();
  machine.kernels = nerf::kernels::ActiveKernels().name;
  machine.has_bf16 = nerf::kernels::HasBf16Products();
  machine.memory_gib = MemoryGib("MemTotal");
  machine.memory_available_gib = MemoryGib("MemAvailable");
  machine.blas = FirstMatch(openblas_get_config(), R"(^(\S+ \S+))");
  machine.blas_kernels = openblas_get_corename();
  machine.blas_threads = openblas_get_num_threads();
  return machine;
}

std::string StartupLine(const Machine& machine) {
  return fmt::format("{} with {} kernels, {} threads; {}; {} cores",
                     machine.blas,
                     machine.blas_kernels,
                     machine.blas_threads,
                     machine.kernels,
                     machine.cores);
}

double MeasureSgemmGflops() {
  constexpr int kSize = 1024;           // large enough for full speed, small enough for several runs
  constexpr double kDuration_s = 0.33;  // after the first, which also wakes the threads
  const std::vector<float> a(kSize * kSize, 0.5f), b(kSize * kSize, 0.25f);
  std::vector<float> c(kSize * kSize);
  using Clock = std::chrono::steady_clock;
  const auto seconds_since = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  const auto multiply = [&] {
    cblas_sgemm(CblasRowMajor,
                CblasNoTrans,
                CblasNoTrans,
                kSize,
                kSize,
                kSize,
                1.f,
                a.data(),
                kSize,
                b.data(),
                kSize,
                0.f,
                c.data(),
                kSize);
  };
  multiply();
  double best_s = 1e9;
  for (const auto start = Clock::now(); seconds_since(start) < kDuration_s;) {
    const auto start_one = Clock::now();
    multiply();
    best_s = std::min(best_s, seconds_since(start_one));
  }
  return 2e-9 * kSize * kSize * kSize / best_s;
}

Program FindColmap() {
  Program program;
  const auto path = io::FindProgram("colmap");
  if (!path) return {.fault = "not on PATH"};
  program.path = *path;
  program.version = FirstMatch(OutputOf({path->string(), "help"}), R"(COLMAP (\d+\.\d+[.\d]*))");
  if (program.version.empty()) program.fault = "does not state its version";
  return program;
}

Program FindFfmpeg() {
  Program program;
  const auto path = io::FindProgram("ffmpeg");
  if (!path) return {.fault = "not on PATH"};
  program.path = *path;
  program.version = FirstMatch(OutputOf({path->string(), "-version"}), R"(ffmpeg version (\S+))");
  const std::string encoders = OutputOf({path->string(), "-nostdin", "-hide_banner", "-encoders"});
  if (encoders.find("libx264") == std::string::npos) program.fault = "was built without libx264";
  return program;
}

Program FindTorch() {
  Program program = ProgramBeside("pipeline-torch");
  if (!program.fault.empty()) return program;
  program.version = FirstMatch(OutputOf({program.path.string(), "--version"}), R"((LibTorch [^\n]*))");
  if (program.version.empty()) program.fault = "does not start";
  return program;
}

Program FindExporter() {
  Program program = ProgramBeside("pipeline-export");
  if (!program.fault.empty()) return program;
  if (OutputOf({program.path.string(), "--help"}).find("--mesh") != std::string::npos)
    program.version = "meshes and other exports";
  else
    program.fault = "does not start";
  return program;
}

}  // namespace pipeline
