// The benchmarks behind `pipeline bench WHAT`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace pipeline {

// Return the process's exit code and never throw.
int RunBench(int argc, const char* const* argv);         // `pipeline bench`
int RunBenchSfm(int argc, const char* const* argv);      // `pipeline bench sfm`
int RunBenchKernels(int argc, const char* const* argv);  // `pipeline bench kernels`
int RunBenchTrain(int argc, const char* const* argv);    // `pipeline bench train`

struct MatrixOptions {
  std::filesystem::path out;       // receives matrix.csv
  std::vector<std::string> cases;  // "S05" stands for all its variants; empty: all cases
  int seeds = 1;                   // 1 .. seeds
  int threads = 1;
};

// Reconstructs every hard case of structure-from-motion (sfm/synthetic/hard_cases.h) with every seed; prints
// one line per case and writes one per run. A case passes when all seeds do (without noise) or 95 % of them
// (with), and none delivers a folded model. Throws kUsage for an unknown case.
void RunMatrix(const MatrixOptions& options);

struct SweepOptions {
  std::filesystem::path out, images, truth;  // truth may be empty
  std::vector<int> pictures;                 // that many, evenly chosen; 0: all
  std::vector<int> features, sizes;          // sizes: longest side in pixels, 0: full size
  std::vector<std::string> matching, detectors;
  bool colmap = false;  // also COLMAP's own presets
  int threads = 1;
};

// Reconstructs the pictures of a folder once with every combination of the knobs; writes results.csv,
// work_precision.svg and, for several numbers of pictures, cost_growth.svg; prints the table. A run that
// fails stays in the table with its cause. Throws kBadInput when the folder holds no pictures or the truth
// cannot be read.
void RunSweep(const SweepOptions& options);

struct KernelOptions {
  std::filesystem::path out;  // receives kernels.csv
  int features = 4096;        // per picture
};

// Times the matching kernel of every build that this processor can run, and beside it what one core can do
// at most; prints a table and writes kernels.csv.
void RunKernels(const KernelOptions& options);

}  // namespace pipeline
