#include "pipeline/ingest/run_input.h"

#include "io/base/error.h"
#include "io/scene/colmap_model.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

bool IsGlob(const fs::path& path) { return path.string().find_first_of("*?[") != std::string::npos; }

fs::path WithoutTrailingSlash(const fs::path& path) {
  const fs::path absolute = fs::absolute(path).lexically_normal();
  return absolute.has_filename() ? absolute : absolute.parent_path();
}

}  // namespace

RunInput ExamineInput(const fs::path& input) {
  RunInput result{.path = WithoutTrailingSlash(input)};
  std::error_code error;
  if (!fs::exists(result.path, error)) {
    if (!error && IsGlob(input)) return result;
    throw io::Error(io::ExitCode::kBadInput,
                    input.string() + ": " + (error ? error.message() : "no such file or folder"),
                    "Give a folder of pictures, a quoted glob, a video, a transforms.json or a COLMAP model");
  }
  if (!fs::is_directory(result.path, error)) {
    if (result.path.extension() == ".json") result.poses = result.path;
    return result;
  }
  for (const char* name : {"transforms.json", "transforms_train.json"}) {
    if (fs::exists(result.path / name, error)) result.poses = result.path;
  }
  if (!result.poses.empty()) return result;
  if (io::IsColmapModel(result.path)) {
    result.poses = result.path;
  } else if (fs::is_directory(result.path / "images", error)) {
    for (const char* name : {"sparse/0", "sparse"}) {
      if (!io::IsColmapModel(result.path / name)) continue;
      result.poses = result.path / name;
      result.images = result.path / "images";
      break;
    }
  }
  return result;
}

fs::path DefaultRunFolder(const fs::path& input) {
  fs::path base = WithoutTrailingSlash(input);
  std::error_code error;
  if (!fs::exists(base, error)) {
    while (IsGlob(base)) base = base.parent_path();
  } else if (!fs::is_directory(base, error)) {
    base.replace_extension();
  }
  return base.string() + ".run";
}

}  // namespace pipeline
