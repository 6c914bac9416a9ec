// measure_mesh: the mesh of a run on the sample capture against the true surface.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <thread>

#include "io/scene/transforms.h"
#include "nerf/surface/surface.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "samples/mesh_truth.h"

namespace {

namespace fs = std::filesystem;

constexpr double kFigurineHeight = 1.3;  // the subject's size
constexpr double kReachShare = 0.01;     // of it: how near counts as reconstructed

void Measure(const fs::path& run,
             const fs::path& capture,
             const fs::path& out,
             nerf::SurfaceOptions options) {
  const io::Scene train = io::ReadTransforms(run / "scene/transforms_train.json").scene;
  const auto field = nerf::TrainedField::Load(run / "train/checkpoint.bin");
  const auto start = std::chrono::steady_clock::now();
  const nerf::Surface surface = nerf::ExtractSurface(*field, train, options);
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  for (const std::string& decision : surface.Decisions()) std::printf("%s\n", decision.c_str());
  std::printf("%.1f s\n", wall.count());
  if (!out.empty()) {
    io::WriteMeshPly(out / "mesh.ply", surface.mesh);
    io::WriteMeshGlb(out / "mesh.glb", surface.mesh);
  }
  const io::Scene truth = io::ReadTransforms(capture / "truth/transforms.json").scene;
  for (const samples::MeshFit& fit : samples::CompareMesh(
           surface.mesh,
           train,
           truth,
           {.box = surface.box, .reach = kReachShare * kFigurineHeight, .threads = options.threads})) {
    std::printf(
        "%s: median distance %.2f %%, 90 %% within %.2f %% of the figurine's height (%zu points);\n"
        "  %.1f %% of %zu true points within %.0f %%\n",
        fit.region.c_str(),
        100 * fit.median / kFigurineHeight,
        100 * fit.q90 / kFigurineHeight,
        fit.mesh_points,
        100 * fit.share_within,
        fit.true_points,
        100 * kReachShare);
  }
}

}  // namespace

int main(int argc, char** argv) {
  return pipeline::GuardedMain("measure_mesh", [&] {
    fs::path run, capture, out;
    nerf::SurfaceOptions surface;
    int triangles = static_cast<int>(surface.triangles);
    surface.threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    pipeline::Options options("measure_mesh",
                              "Measures the mesh of a run on the sample capture against its truth.");
    options.Add("run", &run, "run folder with a trained field");
    options.Add("capture", &capture, "what make_capture wrote");
    options.Add("out", &out, "folder for mesh.ply and mesh.glb; empty: none");
    options.Add("voxel", &surface.voxel, "side of a cell, scene units; 0: a pixel's footprint");
    options.Add("triangles", &triangles, "at most");
    options.Add("threads", &surface.threads, "does not change the result");
    if (!options.Parse(argc, argv)) return;
    surface.triangles = static_cast<std::size_t>(std::max(1, triangles));
    Measure(run, capture, out, surface);
  });
}
