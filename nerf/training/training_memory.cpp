#include "nerf/training/training_memory.h"

#include <fmt/format.h>

#include "nerf/kernels/kernels.h"
#include "nerf/training/splat_fit.h"

namespace nerf {
namespace {

// Occupancy grid, batch, monitoring and what else does not depend on the scene; of LibTorch with its graph.
constexpr std::size_t kHashBytes = std::size_t{96} << 20, kMlpBytes = std::size_t{512} << 20;

}  // namespace

std::size_t PictureBytes(std::size_t n_pixels, int channels) {
  return n_pixels * static_cast<std::size_t>(channels == 4 ? 6 : 3);
}

std::size_t TrainedFieldBytes(const TrainOptions& options, bool has_alpha) {
  if (options.field.kind == FieldKind::kMlp) return kMlpBytes;
  const TrainingSchedule schedule = ScheduleOf(options, has_alpha);
  const std::size_t level = (std::size_t{1} << schedule.log2_hashmap_size) * kernels::kFeatures;
  const std::size_t table = level * static_cast<std::size_t>(HashGridOptions().n_levels);
  // Values and their rounded copies; moments of each value, or one of each entry.
  const std::size_t moments =
      schedule.entry_moments ? sizeof(float) * table / kernels::kFeatures : 2 * sizeof(float) * table;
  const std::size_t gradients = static_cast<std::size_t>(options.threads) * level * sizeof(float);
  return table * (sizeof(float) + sizeof(kernels::Bf16)) + moments + gradients + kHashBytes;
}

void RequireTrainingMemory(const io::Scene& scene, const TrainOptions& options) {
  const int channels = StoredChannels(scene);
  const std::size_t n_pixels = CountPixels(scene);
  const std::size_t splats = options.splats && channels == 3 ? SplatFit::Bytes(n_pixels) : 0;
  options.memory.Require(
      PictureBytes(n_pixels, channels) + TrainedFieldBytes(options, channels == 4) + splats,
      fmt::format("training on {} pictures", scene.frames.size()));
}

void RequireHullMemory(const Dataset& dataset, const TrainOptions& options) {
  options.memory.Require(
      PictureBytes(dataset.n_pixels(), 4) - dataset.pixels.size() + TrainedFieldBytes(options, true),
      fmt::format("training on {} pictures", dataset.views.size()));
}

}  // namespace nerf
