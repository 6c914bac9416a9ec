// The state of a training run in one file: field and splats, Adam moments, occupancy, schedule. A format of
// our own that holds data alone, so that reading a file never runs code from it:
//   8 bytes magic "NERFCKP8", 4 bytes header length (little endian, <= 1 MiB), JSON header, raw
//   tensors (float32, and bytes for the occupancy grid's distances).
// The header lists each tensor's size and XXH3 hash, and the hash of the header itself follows the magic's
// length field.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "nerf/fields/scene_field.h"
#include "nerf/splatting/splat_optimizer.h"

namespace nerf {

// Of the fit of the splats in SceneField.
struct SplatState {
  SplatMoments moments;       // empty once the fit is finished
  std::uint64_t step = 0;     // finished steps
  bool is_judged = false;     // whether pictures that were set aside have been looked at ...
  double error_ratio = 2;     // ... and their squared error over that of their neighbours; or a guess
  double begin_s = 0;         // TrainState::elapsed_s when the fit began
  double squared_error = -1;  // running mean over pixels and channels; -1: none yet
};

// Of transients in the training pictures, see training/transient_masks.h.
struct TransientState {
  std::vector<std::uint8_t> shown;  // as FindTransients has it
  std::uint64_t last_look = 0;      // steps of the field before it; 0: none yet
};

struct TrainState {
  std::uint64_t seed = 1;
  std::uint64_t step = 0;          // finished steps
  double budget_s = 0;             // TrainOptions::time_s when training began
  double elapsed_s = 0;            // training time used, monitoring excluded
  double field_s = 0;              // of that, by the field
  int n_rays = 2048;               // size of the next batch
  double learning_rate_scale = 1;  // halved after each non-finite step
  int skipped_steps = 0, restarts = 0;
  double squared_error = -1;   // running mean over pixels and channels; -1: none yet
  int channels = 3;            // of the pictures
  std::vector<float> cameras;  // what refining them keeps, see training/camera_refinement.h; may be empty
  TransientState transients;
  SplatState splats;
};

void WriteCheckpoint(const std::filesystem::path& path, SceneField* scene_field, const TrainState& state);

// Throws kBadState naming the check that failed: length, magic, header, tensor sizes, hashes.
std::unique_ptr<SceneField> ReadCheckpoint(const std::filesystem::path& path, TrainState* state);

// The kind of field in a checkpoint, from its header alone. Throws as ReadCheckpoint.
FieldKind KindOfCheckpoint(const std::filesystem::path& path);

}  // namespace nerf
