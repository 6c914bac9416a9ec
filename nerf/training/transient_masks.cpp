#include "nerf/training/transient_masks.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/base/error.h"

namespace nerf {
namespace {

// Pixels that a transient is made larger by: until so many steps more, for the field may have learnt a part
// of it, which shows once nothing around holds it.
constexpr int kLastMargin = 2, kFirstMargin = 5;
constexpr std::uint64_t kFirstMarginSteps = 1000;
// More than this share of the pixels is no passer-by: the field does not show the scene.
constexpr double kMostLeftOut = 0.3;
// Less is not worth further looks.
constexpr double kFewLeftOut = 0.003;

}  // namespace

TransientMasks::TransientMasks(const io::Scene& scene,
                               Dataset* dataset,
                               TrainState* state,
                               io::Workers* workers)
    : scene_(scene),
      dataset_(dataset),
      state_(&state->transients),
      n_steps_(state->step),
      workers_(workers),
      n_used_(dataset->n_used()),
      used_(dataset->UsedPixels()),
      depths_(dataset->depths) {
  Apply();
}

void TransientMasks::BeforeStep(const FieldFit& field) {
  if (state_->last_look != applied_look_) Apply();  // training began anew
  const bool is_over = state_->last_look > kFirstLook && ShareLeftOut() < kFewLeftOut;
  if (is_over || n_steps_ < std::max(kFirstLook, kGrowth * state_->last_look)) return;
  const int margin = n_steps_ < kFirstMarginSteps ? kFirstMargin : kLastMargin;
  state_->shown =
      FindTransients(scene_, field.WorldFromCam(), *dataset_, used_, margin, *field.scene_field(), workers_);
  state_->last_look = n_steps_;
  Apply();
  if (ShareLeftOut() <= kMostLeftOut) return;
  state_->shown.clear();
  Apply();
}

void TransientMasks::Apply() {
  const std::vector<std::uint8_t>& shown = state_->shown;
  applied_look_ = state_->last_look;
  std::vector<bool> used = used_;
  if (!shown.empty() && used.empty()) used.assign(dataset_->n_pixels(), true);
  std::size_t first = 0;  // of the view's small picture
  for (std::size_t v = 0; v < dataset_->views.size() && !shown.empty(); ++v) {
    const View& view = dataset_->views[v];
    const io::Camera small = TransientCamera(scene_, v);
    const std::size_t end = first + static_cast<std::size_t>(small.width * small.height);
    if (end > shown.size())
      throw io::Error(io::ExitCode::kBadState,
                      "checkpoint.bin: its transients are those of other pictures",
                      "Delete it and train again");
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const int in_small = y * small.height / view.height * small.width + x * small.width / view.width;
        if (shown[first + static_cast<std::size_t>(in_small)] == 1)
          used[view.first_pixel + static_cast<std::size_t>(y * view.width + x)] = false;
      }
    }
    first = end;
  }
  dataset_->Use(used);
  dataset_->depths.clear();
  for (const SparseDepth& depth : depths_) {
    if (used.empty() || used[dataset_->PixelOf(depth)]) dataset_->depths.push_back(depth);
  }
}

double TransientMasks::ShareLeftOut() const {
  return 1 - static_cast<double>(dataset_->n_used()) / static_cast<double>(n_used_);
}

std::vector<io::Mask> TransientMasks::Masks() const {
  std::vector<io::Mask> masks(state_->shown.empty() ? 0 : dataset_->views.size());
  const std::vector<bool> used = dataset_->UsedPixels();
  std::size_t first = 0;
  for (std::size_t v = 0; v < masks.size(); ++v) {
    const io::Camera small = TransientCamera(scene_, v);
    const auto begin = state_->shown.begin() + static_cast<std::ptrdiff_t>(first),
               end = begin + small.width * small.height;
    first += static_cast<std::size_t>(small.width * small.height);
    if (std::find(begin, end, 1) == end) continue;
    const View& view = dataset_->views[v];
    masks[v] = {.width = view.width, .height = view.height, .used = {}};
    for (std::size_t i = 0; i < view.n_pixels(); ++i)
      masks[v].used.push_back(used[view.first_pixel + i] ? 255 : 0);
    if (masks[v].UsedCount() == 0) masks[v] = {};
  }
  return masks;
}

std::string TransientMasks::Describe() const {
  if (state_->shown.empty()) return "";
  const std::vector<io::Mask> masks = Masks();
  const auto n =
      std::count_if(masks.begin(), masks.end(), [](const io::Mask& mask) { return !mask.used.empty(); });
  return fmt::format(
      "{} of {} training pictures show what the others do not, such as passers-by: {:.1f} % of the pixels "
      "are left out",
      n,
      masks.size(),
      100 * ShareLeftOut());
}

}  // namespace nerf
