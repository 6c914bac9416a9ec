// transforms.json, read strictly in its three dialects (NeRF-synthetic, instant-ngp, nerfstudio) and written
// so that every known reader accepts it. Unknown, contradictory or out-of-range content is an error, never a
// guess.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/scene/scene.h"

namespace io {

enum class TransformsDialect { kBlender, kInstantNgp, kNerfstudio };

struct TransformsFile {
  // Image and mask paths are absolute; points come from ply_file_path when present; near, far, aabb and
  // scene_from_sfm are set when we wrote the file.
  Scene scene;
  TransformsDialect dialect = TransformsDialect::kNerfstudio;
  std::vector<std::string> missing_images;  // file_path of frames without a picture; not in `scene`
  bool has_near_far = false;       // the file states near, far, aabb and scene_from_sfm (written by us)
  std::vector<std::string> notes;  // what was ignored or repaired, one line each
};

// Poses are world_from_cam, OpenGL axes, as stored (no re-centring, no scaling). mask_path, nerfstudio's key,
// may stand in any frame of any dialect; a mask that is missing or differs in size from its picture is a
// fault. Throws kBadInput with the JSON path or line of the fault.
TransformsFile ReadTransforms(const std::filesystem::path& json_path);

// Pictures and masks must share the folder of `json_path` or lie below it; paths are written relative with
// '/'. nerfstudio reads mask_path only where every frame has one.
// `ply_name` is the name, beside the file, of the point cloud that the file refers to; empty: none. Near,
// far, aabb and scene_from_sfm are written only when the aabb has a volume, that is, once the scene is
// normalised.
void WriteTransforms(const std::filesystem::path& json_path, const Scene& scene, const std::string& ply_name);

// The same in the dialect of the NeRF-synthetic scenes, transforms_train.json and its like. Their readers
// know one camera for all pictures, its horizontal angle of view, and PNG files named without ".png"; what a
// camera has beside the angle is added in keys that they pass over. Pictures must be PNG files.
void WriteBlenderTransforms(const std::filesystem::path& json_path, const Scene& scene);

}  // namespace io
