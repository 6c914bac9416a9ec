#include "nerf/training/splat_shares.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "nerf/rendering/ray_renderer.h"
#include "nerf/rendering/splat_mixing.h"

namespace nerf {
namespace {

// Views that are rendered to judge the field before the splats, and to compare both.
constexpr std::size_t kViewsJudged = 8, kViewsCompared = 64;
// Pixels are compared in every so many rows and columns, others in each view.
constexpr int kStride = 3;
// So many pixels of average difference say in each cell that it is as everywhere.
constexpr double kPriorPixels = 5;
// A share of 0 or 1 has no odds; a few pixels tell none beyond.
constexpr double kLeastMeasured = 0.01;
constexpr std::array<float, 3> kBlack = {0, 0, 0};

// At most n of them, evenly.
std::vector<std::size_t> Some(std::span<const std::size_t> views, std::size_t n) {
  std::vector<std::size_t> some;
  for (std::size_t i = 0; i < views.size(); i += 1 + (views.size() - 1) / n) some.push_back(views[i]);
  return some;
}

double OddsOf(double share) {
  share = std::clamp(share, kLeastMeasured, 1 - kLeastMeasured);
  return share / (1 - share);
}

// The share s that makes field + s (splats - field) come closest to the photographs.
struct BestShare {
  double along = 0, squares = 0;  // sums of (splats - field) . (photo - field) and of (splats - field)^2

  void Add(const BestShare& other) { along += other.along, squares += other.squares; }
  double Share() const { return along / squares; }
};

// Calls visit(place, its BestShare) for pixels of a view that have a place and are to show splats.
template <typename Visit>
void Compare(const SceneField& scene_field,
             const SplatTarget& target,
             int first,
             SplatRasteriser* rasteriser,
             io::Workers* workers,
             const Visit& visit) {
  const io::Camera& camera = target.view.camera;
  const RayCamera ray_camera(camera, target.view.world_from_cam, scene_field.field->pixel_offset());
  std::vector<CameraPixel> pixels;
  for (int y = first / kStride % kStride; y < camera.height; y += kStride) {
    for (int x = first % kStride; x < camera.width; x += kStride) {
      if (IsShown(target, static_cast<std::size_t>(y * camera.width + x)))
        pixels.push_back({&ray_camera, x, y});
    }
  }
  const std::vector<RenderedRay> rays =
      RenderPixels(scene_field, pixels, scene_field.samples_per_pixel, scene_field.step_scale, workers);
  const SplatPicture splats = rasteriser->Render(scene_field.splats, target.view);
  const std::array<float, 3> background = scene_field.Background(false, kBlack);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto place = PlaceOfSurface(
        scene_field.contraction, ray_camera.RayThrough(pixels[i].x, pixels[i].y), rays[i].median_depth);
    if (!place) continue;
    const auto at = static_cast<std::size_t>(pixels[i].y * camera.width + pixels[i].x);
    BestShare best;
    for (std::size_t c = 0; c < 3; ++c) {
      const double field = rays[i].rgb[c] + rays[i].transmittance * background[c];
      const double over = splats.rgb[3 * at + c] + splats.transmittance[at] * field;
      const double photo = target.rgba[4 * at + c] / 255.0;
      best.Add({(over - field) * (photo - field), (over - field) * (over - field)});
    }
    visit(*place, best);
  }
}

}  // namespace

double FieldBeforeShare(const SceneField& scene_field,
                        const SplatPhotos& photos,
                        std::span<const std::size_t> views,
                        io::Workers* workers) {
  SplatRasteriser rasteriser(workers);
  double sum = 0, n = 0;
  for (const std::size_t view : Some(views, kViewsJudged)) {
    const io::Camera camera = photos.Camera(view, kSplatPhotoSide / 2);
    const io::Rigid3d& world_from_cam = photos.world_from_cam(view);
    const RayCamera ray_camera(camera, world_from_cam, scene_field.field->pixel_offset());
    std::vector<CameraPixel> pixels;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) pixels.push_back({&ray_camera, x, y});
    }
    std::vector<float> median_depth;
    for (const RenderedRay& ray :
         RenderPixels(scene_field, pixels, 1, scene_field.step_scale, workers, {}, RayValues::kDepths))
      median_depth.push_back(ray.median_depth);
    for (const float value :
         FieldBeforeSplats(scene_field.splats, camera, world_from_cam, median_depth, &rasteriser))
      sum += value;
    n += static_cast<double>(median_depth.size());
  }
  return sum / n;
}

ShareMap SharesByPlace(const SceneField& scene_field,
                       const SplatPhotos& photos,
                       std::span<const std::size_t> views,
                       io::Workers* workers) {
  SplatRasteriser rasteriser(workers);
  std::vector<BestShare> cells(ShareMap::kCells);
  BestShare all;
  double n = 0;
  int first = 0;
  for (const std::size_t view : Some(views, kViewsCompared)) {
    const auto add = [&](const UnitPlace& place, const BestShare& pixel) {
      cells[ShareMap::CellAt(place)].Add(pixel);
      all.Add(pixel);
      ++n;
    };
    Compare(scene_field, photos.Target(view), first++, &rasteriser, workers, add);
  }
  if (all.squares == 0) return {};
  const double squares = kPriorPixels * all.squares / n;
  const BestShare prior{squares * all.Share(), squares};
  const double times = OddsOf(scene_field.splat_share) / std::sqrt(OddsOf(all.Share()));
  ShareMap shares;
  for (BestShare& cell : cells) {
    cell.Add(prior);
    const double odds = times * std::sqrt(OddsOf(cell.Share()));
    shares.cells.push_back(static_cast<std::uint8_t>(std::lround(255 * odds / (1 + odds))));
  }
  return shares;
}

}  // namespace nerf
