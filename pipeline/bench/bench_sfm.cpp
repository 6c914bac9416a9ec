// `pipeline bench sfm`: how right poses are, and what they cost.
#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "pipeline/bench/bench.h"
#include "pipeline/bench/bench_table.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"

namespace pipeline {

int RunBenchSfm(int argc, const char* const* argv) {
  return GuardedMain("pipeline bench sfm", [&] {
    CommonOptions common;
    MatrixOptions matrix;
    SweepOptions sweep;
    bool wants_matrix = false, wants_kernels = false;
    std::string cases, features = "1024,2048,4096,8192", sizes = "800,1600,0", matching = "likely,exhaustive",
                       pictures = "0", detectors = "opencv";
    Options options("pipeline bench sfm",
                    "Measures structure-from-motion: generated hard cases with truth, the knobs of "
                    "`pipeline sfm` on a folder of pictures, and the matching kernel.");
    options.Add("out",
                &common.out,
                "folder for matrix.csv, results.csv, work_precision.svg, kernels.csv",
                {.required = "DIR"});
    options.Add("threads", &common.threads, "0 = all cores", {.min = 0});
    options.Add("matrix", &wants_matrix, "run the hard cases");
    options.Add("seeds", &matrix.seeds, "seeds per hard case", {.min = 1});
    options.Add("cases", &cases, "hard cases to run, such as S01,S05.2; if not given, all");
    options.Add("images", &sweep.images, "folder of pictures for the sweep of the knobs");
    options.Add("truth",
                &sweep.truth,
                "true poses of these pictures: a transforms.json or a folder of *.camera files (Strecha)");
    options.Add("pictures", &pictures, "numbers of pictures, evenly chosen from the folder; 0 = all");
    options.Add("features", &features, "features per picture");
    options.Add("sizes", &sizes, "longest side for detection [px]; 0 = full size");
    options.Add("detectors", &detectors, "whose SIFT: opencv, colmap");
    options.Add("matching", &matching, "ways of choosing pairs");
    options.Add("colmap", &sweep.colmap, "also run COLMAP's own presets");
    options.Add("kernels", &wants_kernels, "time the matching kernel beside the processor's peak");
    if (!options.Parse(argc, argv)) return;

    if (!wants_matrix && !wants_kernels && sweep.images.empty()) {
      throw io::Error(io::ExitCode::kUsage,
                      "pipeline bench sfm: nothing to measure",
                      "Give --matrix, --images FOLDER or --kernels");
    }
    matrix.cases = SplitList(cases);
    sweep.pictures = SplitIntegers("pictures", pictures, 0);
    sweep.features = SplitIntegers("features", features, 1);
    sweep.sizes = SplitIntegers("sizes", sizes, 0);
    sweep.matching = SplitList(matching);
    sweep.detectors = SplitList(detectors);
    matrix.out = sweep.out = std::filesystem::absolute(common.out);  // COLMAP works in folders of its own
    matrix.threads = sweep.threads = ResolvedThreads(common);
    io::ClaimFolder(common.out);
    if (wants_kernels) RunKernels({.out = common.out});
    if (wants_matrix) RunMatrix(matrix);
    if (!sweep.images.empty()) RunSweep(sweep);
  });
}

}  // namespace pipeline
