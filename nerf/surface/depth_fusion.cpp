#include "nerf/surface/depth_fusion.h"

#include <algorithm>
#include <cmath>

#include "io/process/interrupt.h"

namespace nerf {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using Eigen::Vector3i;

constexpr int kSide = SparseVolume::kSide;
// Radius of the ball around a block, in blocks.
const float kBlockRadius = 0.5f * std::sqrt(3.f);

bool Before(const Vector3i& a, const Vector3i& b) {
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
}

void SortUnique(std::vector<Vector3i>* places) {
  std::sort(places->begin(), places->end(), Before);
  places->erase(std::unique(places->begin(), places->end()), places->end());
}

// Blocks within the truncation of the view's facets, along their rays.
std::vector<Vector3i> PlacesOf(const DepthView& view, const FusionOptions& options, io::Workers* workers) {
  const std::vector<Facet> facets = FacetsOf(view, workers);
  const double block = options.voxel * kSide;
  const int n_steps = static_cast<int>(std::ceil(4 * options.truncation / block));
  std::vector<std::vector<Vector3i>> of_row(static_cast<std::size_t>(view.camera.height));
  workers->Run(view.camera.height, [&](int y, int) {
    std::vector<Vector3i>& places = of_row[static_cast<std::size_t>(y)];
    for (int x = 0; x < view.camera.width; ++x) {
      const Facet& facet = facets[static_cast<std::size_t>(y * view.camera.width + x)];
      if (facet.weight == 0) continue;
      const Vector3d in_cam = facet.point.cast<double>(), point = view.world_from_cam * in_cam;
      if ((point.array() < options.box.min.array()).any() || (point.array() > options.box.max.array()).any())
        continue;
      const Vector3d ray = view.world_from_cam.rotation * in_cam.normalized();
      for (int i = 0; i <= n_steps; ++i) {
        const Vector3d at = point + (2.0 * i / n_steps - 1) * options.truncation * ray;
        const Vector3i place = ((at - options.box.min) / block).array().floor().cast<int>();
        if (places.empty() || places.back() != place) places.push_back(place);
      }
    }
    SortUnique(&places);
  });
  std::vector<Vector3i> all;
  for (const std::vector<Vector3i>& places : of_row) all.insert(all.end(), places.begin(), places.end());
  SortUnique(&all);
  return all;
}

// A view ready to be asked about many samples.
class Observer {
 public:
  Observer(const DepthView& view, double truncation, io::Workers* workers)
      : facets_(FacetsOf(view, workers)),
        rotation_(view.cam_from_world.rotation.cast<float>()),
        translation_(view.cam_from_world.translation),
        exact_rotation_(view.cam_from_world.rotation),
        truncation_(static_cast<float>(truncation)),
        fl_x_(static_cast<float>(view.camera.fl_x)),
        fl_y_(static_cast<float>(view.camera.fl_y)),
        cx_(static_cast<float>(view.camera.cx)),
        cy_(static_cast<float>(view.camera.cy)),
        width_(view.camera.width),
        height_(view.camera.height) {}

  // Adds the view to the sums of a block: w d, and w.
  void Observe(const SparseVolume& volume,
               std::size_t block,
               SparseVolume::Block* distances,
               SparseVolume::Block* weights) const {
    const auto voxel = static_cast<float>(volume.voxel());
    const Vector3f corner = (exact_rotation_ * volume.Corner(block) + translation_).cast<float>();
    const Vector3f step_x = voxel * rotation_.col(0), step_y = voxel * rotation_.col(1),
                   step_z = voxel * rotation_.col(2);
    if (!MaySee(corner + 0.5f * kSide * (step_x + step_y + step_z), kBlockRadius * voxel * kSide)) return;
    std::size_t i = 0;
    for (int z = 0; z < kSide; ++z) {
      for (int y = 0; y < kSide; ++y) {
        Vector3f at = corner + static_cast<float>(y) * step_y + static_cast<float>(z) * step_z;
        for (int x = 0; x < kSide; ++x, ++i, at += step_x) Add(at, &(*distances)[i], &(*weights)[i]);
      }
    }
  }

 private:
  void Add(const Vector3f& at, float* distance, float* weight) const {
    const float depth = -at.z();
    if (!(depth > 0)) return;
    const float u = fl_x_ * at.x() / depth + cx_, v = cy_ - fl_y_ * at.y() / depth;
    if (!(u >= 0 && v >= 0 && u < static_cast<float>(width_) && v < static_cast<float>(height_))) return;
    const Facet& facet =
        facets_[static_cast<std::size_t>(static_cast<int>(v) * width_ + static_cast<int>(u))];
    if (facet.is_empty) {
      const float empty_weight = 1 / (depth * depth);
      *distance += empty_weight * truncation_;
      *weight += empty_weight;
      return;
    }
    if (facet.weight == 0) return;
    const float d = facet.normal.dot(at - facet.point);
    if (d < -truncation_) return;
    *distance += facet.weight * std::min(d, truncation_);
    *weight += facet.weight;
  }

  // False when the ball lies outside of the picture.
  bool MaySee(const Vector3f& centre, float radius) const {
    const float depth = -centre.z();
    if (depth <= radius) return depth > -radius;
    const float slack = std::max(fl_x_, fl_y_) * radius / (depth - radius) * centre.norm() / depth;
    const float u = fl_x_ * centre.x() / depth + cx_, v = cy_ - fl_y_ * centre.y() / depth;
    return u > -slack && v > -slack && u < static_cast<float>(width_) + slack &&
           v < static_cast<float>(height_) + slack;
  }

  std::vector<Facet> facets_;
  Eigen::Matrix3f rotation_;
  Vector3d translation_;
  Eigen::Matrix3d exact_rotation_;
  float truncation_, fl_x_, fl_y_, cx_, cy_;
  int width_, height_;
};

}  // namespace

SparseVolume FuseDepthViews(std::span<const DepthView> views,
                            const FusionOptions& options,
                            io::Workers* workers,
                            const std::function<void(double share)>& progress) {
  std::vector<Vector3i> places;
  for (const DepthView& view : views) {
    const std::vector<Vector3i> more = PlacesOf(view, options, workers);
    places.insert(places.end(), more.begin(), more.end());
    SortUnique(&places);
    io::ThrowIfInterrupted();
  }
  SparseVolume volume(options.box.min, options.voxel, std::move(places));
  SparseVolume::Block zero;
  zero.fill(0);
  std::vector<SparseVolume::Block> weights(volume.size(), zero);
  const int n_blocks = static_cast<int>(volume.size());
  workers->Run(n_blocks, [&](int i, int) { volume.block(static_cast<std::size_t>(i)) = zero; });
  for (std::size_t k = 0; k < views.size(); ++k) {
    const Observer observer(views[k], options.truncation, workers);
    workers->Run(n_blocks, [&](int i, int) {
      const auto block = static_cast<std::size_t>(i);
      observer.Observe(volume, block, &volume.block(block), &weights[block]);
    });
    progress(static_cast<double>(k + 1) / static_cast<double>(views.size()));
    io::ThrowIfInterrupted();
  }
  workers->Run(n_blocks, [&](int i, int) {
    const auto block = static_cast<std::size_t>(i);
    for (std::size_t j = 0; j < SparseVolume::kSamples; ++j) {
      const float weight = weights[block][j];
      volume.block(block)[j] = weight > 0 ? volume.block(block)[j] / weight : SparseVolume::kUnknown;
    }
  });
  return volume;
}

}  // namespace nerf
