#include "pipeline/export/export.h"

#include <fmt/format.h>

#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "io/base/error.h"
#include "io/base/quoting.h"
#include "nerf/rendering/trained_field.h"
#include "pipeline/export/cameras_export.h"
#include "pipeline/export/dense_surface.h"
#include "pipeline/export/depth_export.h"
#include "pipeline/export/export_place.h"
#include "pipeline/export/mesh_export.h"
#include "pipeline/export/points_export.h"
#include "pipeline/export/splat_quality.h"
#include "pipeline/export/splat_scene.h"
#include "pipeline/export/splats_export.h"
#include "pipeline/film/camera_path_file.h"
#include "pipeline/page/page_export.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stages/torch_program.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Error;
using io::ExitCode;

struct ExportOptions {
  fs::path run, cameras, points, depth, splats, mesh, page, crop;
  FrameOptions frame;
  SurfaceOptions surface;
  SplatSceneOptions splats_from;
  bool fits_splats = false;  // even where training has
  int max_triangles = 500000;
  CommonOptions common;

  bool NeedsField() const { return !points.empty() || !splats.empty() || !depth.empty() || !mesh.empty(); }
};

// An export is one file, of a name that ends so, or a folder.
struct Target {
  const char* option;
  fs::path ExportOptions::*path;
  std::vector<std::string> extensions;
};
const Target kTargets[] = {{"cameras", &ExportOptions::cameras, {}},
                           {"points", &ExportOptions::points, {".ply"}},
                           {"depth", &ExportOptions::depth, {}},
                           {"splats", &ExportOptions::splats, {".ply"}},
                           {"mesh", &ExportOptions::mesh, {".glb", ".ply"}},
                           {"page", &ExportOptions::page, {".html"}}};

void AddExportOptions(Options* options, ExportOptions* to) {
  options->AddPositional("RUN", &to->run, "run folder", true);
  options->Add(
      "cameras", &to->cameras, "FOLDER: poses, pictures, sparse points for COLMAP, nerfstudio, NeRF");
  options->Add("points", &to->points, "FILE.ply: points of the surface, with normal, colour and support");
  options->Add("depth", &to->depth, "FOLDER: depth, normals and support of every view");
  options->Add("splats", &to->splats, "FILE.ply: the scene as 3D Gaussians, fitted to the photos");
  options->Add("mesh", &to->mesh, "FILE.glb or FILE.ply: the surface as triangles, with normals and colours");
  options->Add("page", &to->page, "FILE.html: the field to look around in, in any browser and offline");
  options->Add("frame",
               &to->frame.frame,
               "coordinates: as normalised, or as the poses came",
               {.choices = {"scene", "sfm"}});
  options->Add(
      "points-apart",
      &to->frame.points_apart,
      "x,y,z,x,y,z=METRES: two points of known distance, in those coordinates; all is then written in "
      "metres",
      {.check = [](const std::string& name, const std::string& text) { ParsePointsApart(name, text); }});
  options->Add(
      "crop",
      &to->crop,
      "camera_path.json with a crop box, as `pipeline view` saves it: points, depth, splats and mesh "
      "hold what lies inside");
  options->Add("max-points", &to->surface.max_points, "most points of the surface", {.min = 1, .max = 1e8});
  options->Add("max-splats", &to->splats_from.max_splats, "most splats, nearly", {.min = 1, .max = 1e8});
  options->Add("splat-steps",
               &to->splats_from.steps,
               "steps in which splats are fitted to pictures; more are better and take longer; 0 = as "
               "they lie on the surface; the splats of the training, if it has any, are written unless this "
               "or --max-splats is given",
               {.min = 0, .max = 1e6});
  options->Add("max-triangles", &to->max_triangles, "most triangles of the mesh", {.min = 1000, .max = 1e8});
  options->Add("view-size",
               &to->surface.view_size,
               "longer side of the views that points and splats come from [px]; 0 = of the training pictures",
               {.min = 0, .max = 16384});
  options->Add("threads", &to->common.threads, "worker threads; 0 = all cores", {.min = 0});
  options->Add("memory",
               &to->common.memory,
               "most memory to take, such as 2G; default: what the machine has free",
               {.check = ParseBytes});
  options->Add("force", &to->common.force, "replace a file that this program did not write");
}

// Refuses, before any work, places that must not be written and exports that would lie in one another.
void CheckTargets(const ExportOptions& options) {
  std::vector<const Target*> given;
  for (const Target& target : kTargets) {
    const fs::path& path = options.*target.path;
    if (path.empty()) continue;
    given.push_back(&target);
    if (target.extensions.empty())
      RequireExportFolder(path, options.run);
    else
      RequireExportFile(path, target.extensions, options.run, options.common.force);
  }
  if (given.empty())
    throw Error(ExitCode::kUsage,
                "nothing to export",
                "Give --cameras, --points, --depth, --splats, --mesh or --page with a place");
  for (const Target* outer : given) {
    for (const Target* inner : given) {
      if (outer != inner && IsWithin(options.*inner->path, options.*outer->path))
        throw Error(ExitCode::kUsage,
                    std::string("--") + inner->option + ": " + (options.*inner->path).string() +
                        " lies in that of --" + outer->option,
                    "Give each export a place of its own");
    }
  }
}

void Say(const char* what, const fs::path& path, const std::string& note = "") {
  std::printf("%-7s %s%s\n", what, io::Printable(path.string()).c_str(), note.c_str());
}

nerf::Splats SplatsOf(const ExportedScene& scene, const ExportOptions& options) {
  SplatSceneOptions splat_options = options.splats_from;
  splat_options.view_size = options.surface.view_size;
  const nerf::Splats& trained = scene.field->splats();
  if (trained.size() > 0 && !scene.crop && !options.fits_splats)
    return WithSky(scene, trained, splat_options);
  return MakeSplats(scene, splat_options);
}

void ExportSplats(const ExportedScene& scene, const ExportOptions& options) {
  const nerf::Splats splats = SplatsOf(scene, options);
  WriteSplats(splats, scene.target, options.splats);
  std::string note = fmt::format("  {} splats", splats.size());
  if (const auto quality = MeasureSplats(scene, splats))
    note +=
        fmt::format(", {:.2f} dB on {} held-out photos (field {:.2f}), {:.2f} dB from the field's pictures",
                    quality->splats_db,
                    quality->views,
                    quality->field_db,
                    quality->apart_db);
  Say("splats", options.splats, note);
}

void Export(const ExportOptions& options) {
  std::optional<nerf::CropBox> crop;
  if (!options.crop.empty()) crop = ReadCrop(options.crop).box;
  const io::MemoryBudget memory = ResolvedMemory(options.common);
  if (options.NeedsField())
    memory.Require(nerf::LoadedFieldBytes(options.run / "train/checkpoint.bin"), "export: the field");
  ExportedScene scene =
      LoadExportedScene(options.run, options.frame, options.NeedsField(), ResolvedThreads(options.common));
  scene.crop = crop;
  if (!options.cameras.empty()) {
    ExportCameras(scene, options.cameras);
    Say("cameras", options.cameras, "  " + std::to_string(ViewsOf(scene).size()) + " views");
  }
  if (!options.page.empty()) {
    const std::size_t bytes =
        ExportPage(scene.train, RequireTrainedField(options.run), scene.name, options.page);
    Say("page", options.page, fmt::format("  {:.1f} MB", static_cast<double>(bytes) / 1e6));
  }
  if (!options.depth.empty()) {
    ExportDepth(scene, options.depth);
    Say("depth", options.depth, "  " + std::to_string(ViewsOf(scene).size()) + " views");
  }
  if (!options.mesh.empty()) {
    const std::size_t triangles = ExportMesh(scene, options.max_triangles, options.mesh);
    Say("mesh", options.mesh, "  " + std::to_string(triangles) + " triangles");
  }
  if (!options.points.empty()) {
    const std::vector<Surfel> surfels = DenseSurface(scene, options.surface);
    ExportPoints(surfels, scene.target, options.points);
    Say("points", options.points, "  " + std::to_string(surfels.size()) + " points");
  }
  if (!options.splats.empty()) ExportSplats(scene, options);
}

}  // namespace

int RunExport(int argc, const char* const* argv) {
  return GuardedMain("pipeline export", [&] {
    ExportOptions options;
    Options bound("pipeline export",
                  "Writes a run for other programs: cameras, points, depth maps, splats, a mesh, a page for "
                  "browsers; any of them in one call.");
    AddExportOptions(&bound, &options);
    if (!bound.Parse(argc, argv)) return;
    options.fits_splats = bound.IsSetByUser("splat-steps") || bound.IsSetByUser("max-splats");
    CheckTargets(options);
    if (options.NeedsField() && NeedsTorch(options.run / "train/checkpoint.bin"))
      ContinueWithTorch("export", argc, argv);
    Export(options);
  });
}

}  // namespace pipeline
