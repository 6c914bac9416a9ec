#include "pipeline/report/scene_page.h"

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/scene/transforms.h"
#include "nerf/fields/checkpoint.h"
#include "pipeline/page/page_export.h"

namespace pipeline {

namespace fs = std::filesystem;

fs::path ScenePagePath(const fs::path& run_folder) { return run_folder / "scene.html"; }

std::string WriteScenePage(const fs::path& run_folder) {
  const fs::path checkpoint = run_folder / "train/checkpoint.bin",
                 transforms = run_folder / "scene/transforms_train.json", page = ScenePagePath(run_folder);
  if (!fs::is_regular_file(checkpoint) || !fs::is_regular_file(transforms)) {
    fs::remove(page);
    return "";
  }
  try {
    const std::size_t bytes = ExportPage(io::ReadTransforms(transforms).scene,
                                         checkpoint,
                                         fs::absolute(run_folder).lexically_normal().filename().string(),
                                         page);
    return fmt::format("scene.html: the field to look around in, {:.1f} MB",
                       static_cast<double>(bytes) / 1e6);
  } catch (const io::Error& error) {
    // A field that no browser shows; the report is worth having without it.
    if (error.code() != io::ExitCode::kBadInput) throw;
    fs::remove(page);
    return std::string("no scene.html: ") + error.what();
  }
}

}  // namespace pipeline
