// What this computer offers: processor, memory, linear algebra, and the external programs that stages start.
#pragma once

#include <filesystem>
#include <string>

namespace pipeline {

struct Machine {
  std::string cpu;        // the processor's own name
  int cores = 0;          // usable by this process
  std::string kernels;    // build of the `hash` field's kernels that runs, see nerf/kernels/kernels.h
  bool has_bf16 = false;  // whether it multiplies bfloat16 in hardware
  double memory_gib = 0, memory_available_gib = 0;
  std::string blas;          // "OpenBLAS 0.3.21"
  std::string blas_kernels;  // the CPU that they were written for: "SkylakeX"
  int blas_threads = 0;
};
Machine DescribeMachine();

// "OpenBLAS 0.3.21 with SkylakeX kernels, 2 threads; avx512bf16; 2 cores"
std::string StartupLine(const Machine& machine);

// Rate of a single-precision matrix product, best of several within about a third of a second.
double MeasureSgemmGflops();

struct Program {
  std::filesystem::path path;  // empty when missing
  std::string version;         // "3.8"; empty when it could not be read
  std::string fault;           // why it cannot serve, one line; empty when it can
};
Program FindColmap();
Program FindFfmpeg();  // can encode H.264 through libx264
// `pipeline-torch`, which trains the `nerf` field; version says which LibTorch and how fast its matrix
// products are.
Program FindTorch();
// `pipeline-export`, which alone needs libraries for meshes; version says what it writes.
Program FindExporter();

}  // namespace pipeline
