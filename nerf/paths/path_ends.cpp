#include "nerf/paths/path_ends.h"

#include <algorithm>
#include <functional>

#include "io/base/check.h"
#include "io/base/median.h"

namespace nerf {
namespace {

constexpr double kMostCut = 0.125;  // of the path, at each end
constexpr int kLooks = 25;          // at each end, and along the path to compare with
constexpr int kSupportSide = 64;    // [px]
// Of the picture, above the median along the path: a chair that one picture shows takes as much.
constexpr double kSlack = 0.05;

class SupportScout {
 public:
  SupportScout(const TrainedField& field, const io::Scene& train, const SupportMap& support, int threads)
      : field_(field),
        support_(support),
        camera_(
            SmallCamera(train.cameras[static_cast<std::size_t>(train.frames[0].camera_index)], kSupportSide)),
        threads_(threads) {}

  // Share of the picture that one view at most supports.
  double WeakShare(const io::Rigid3d& pose) const {
    const RenderOptions options{
        .threads = threads_, .step_scale = 1, .samples_per_pixel = 1, .depth_only = true};
    const ViewSupport support = support_.Of(camera_, pose, field_.Render(camera_, pose, options), threads_);
    const auto weak =
        std::count_if(support.views.begin(), support.views.end(), [](std::uint16_t n) { return n <= 1; });
    return static_cast<double>(weak) / static_cast<double>(support.views.size());
  }

 private:
  const TrainedField& field_;
  const SupportMap& support_;
  const io::Camera camera_;
  const int threads_;
};

}  // namespace

CutEnds CutWeakEnds(const TrainedField& field,
                    const io::Scene& train,
                    const SupportMap& support,
                    int threads,
                    std::vector<io::Rigid3d>* fitted,
                    CameraPath* path) {
  std::vector<io::Rigid3d>& poses = path->world_from_cam;
  PIPELINE_CHECK(fitted->size() == poses.size() &&
                 (path->depths.empty() || path->depths.size() == poses.size()));
  const int n = static_cast<int>(poses.size()), most = static_cast<int>(kMostCut * n);
  if (path->kind != PathKind::kWalk || most == 0) return {};
  const SupportScout scout(field, train, support, threads);
  const auto weak = [&](int i) { return scout.WeakShare(poses[static_cast<std::size_t>(i)]); };
  std::vector<double> along;
  for (int k = 0; k < kLooks; ++k) along.push_back(weak((2 * k + 1) * n / (2 * kLooks)));
  const double limit = io::Median(along) + kSlack;
  // place: of the pose that is so far from the end.
  const auto cut = [&](const std::function<int(int)>& place) {
    for (int i = 0; i <= most; i += std::max(1, most / kLooks)) {
      if (weak(place(i)) <= limit) return i;
    }
    return 0;
  };
  const int first = cut([](int i) { return i; }), last = cut([&](int i) { return n - 1 - i; });
  const auto shorten = [&](auto* values) {
    values->erase(values->end() - last, values->end());
    values->erase(values->begin(), values->begin() + first);
  };
  shorten(fitted);
  shorten(&poses);
  if (!path->depths.empty()) shorten(&path->depths);
  return {static_cast<double>(first) / n, static_cast<double>(last) / n};
}

}  // namespace nerf
