#include "nerf/training/field_surface.h"

#include <Eigen/Geometry>
#include <cmath>

#include "io/base/random.h"
#include "nerf/rendering/ray_renderer.h"

namespace nerf {
namespace {

using Eigen::Vector3f;

// Distance of the sky, in units of the sampling's far.
constexpr float kSkyDistance = 10;
// Between a pixel and those beside it: far enough to even out what is left of the sampling interval in the
// depth.
constexpr int kBeside = 2;
// Their distances differ by at most so many footprints per pixel on one surface: a slant of 80 degrees.
constexpr float kSteepest = 6;
// Rays per pixel: itself, along its row, along its column.
constexpr std::size_t kRays = 3;
// Of the pixels: chosen without regard to what they show.
constexpr float kEvenShare = 0.5f;
// Times the mean contrast: pixels with more are all the same to the choice.
constexpr float kMostContrast = 4;
// Pixels that the mean contrast is taken over.
constexpr int kSampled = 10000;
// Pixels drawn until one is chosen by its contrast: where photos are of one colour, none ever is.
constexpr int kMostDraws = 64;
// Pixels whose rays are in memory together.
constexpr std::size_t kBatch = 1 << 15;

struct ChosenPixel {
  const View* view;
  std::size_t pixel;  // of the dataset
  int x, y;
  int right, down;  // steps to the pixels beside it, which lie in the picture

  Vector3f Direction(int dx, int dy) const {
    return Vector3f(view->camera.RayThrough(x + dx, y + dy).direction);
  }
};

ChosenPixel PixelAt(const Dataset& dataset, std::size_t pixel) {
  const View& view = dataset.ViewOf(pixel);
  const auto in_view = static_cast<int>(pixel - view.first_pixel);
  const int x = in_view % view.width, y = in_view / view.width;
  return {&view, pixel, x, y, x >= kBeside ? -kBeside : kBeside, y >= kBeside ? -kBeside : kBeside};
}

// Chooses pixels: kEvenShare of them evenly, the others in proportion to how much the photograph changes
// there.
class PixelChoice {
 public:
  PixelChoice(const Dataset& dataset, std::uint64_t seed) : dataset_(dataset), seed_(seed) {
    io::Random random(seed, io::Stream::kSplat, 1, 0);
    for (int i = 0; i < kSampled; ++i) mean_contrast_ += Contrast(Even(&random)) / kSampled;
  }

  ChosenPixel operator()(std::size_t index) const {
    io::Random random(seed_, io::Stream::kSplat, 0, index);
    const bool is_even = random.Uniform() < kEvenShare;
    ChosenPixel pixel = Even(&random);
    for (int i = 0; i < kMostDraws && !is_even; ++i) {
      if (random.Uniform() * kMostContrast * mean_contrast_ < Contrast(pixel)) break;
      pixel = Even(&random);
    }
    return pixel;
  }

 private:
  ChosenPixel Even(io::Random* random) const {
    const auto n_used = static_cast<std::uint32_t>(dataset_.n_used());
    return PixelAt(dataset_, dataset_.UsedPixel(random->Below(n_used)));
  }
  // Sum of the absolute differences from the two pixels beside it, in grey levels.
  double Contrast(const ChosenPixel& chosen) const {
    const auto channels = static_cast<std::ptrdiff_t>(dataset_.channels);
    const auto here = dataset_.pixels.begin() + static_cast<std::ptrdiff_t>(chosen.pixel) * channels;
    int sum = 0;
    for (const int step : {chosen.right, chosen.down * chosen.view->width}) {
      for (std::ptrdiff_t c = 0; c < channels; ++c) sum += std::abs(here[step * channels + c] - here[c]);
    }
    return sum;
  }

  const Dataset& dataset_;
  const std::uint64_t seed_;
  double mean_contrast_ = 0;
};

// rays: those of the pixel and of the two beside it.
void AddPoint(const SceneField& scene_field,
              const Dataset& dataset,
              const ChosenPixel& chosen,
              const RenderedRay* rays,
              std::vector<SurfacePoint>* points) {
  const Vector3f ray = chosen.Direction(0, 0), along_row = chosen.Direction(chosen.right, 0),
                 along_column = chosen.Direction(0, chosen.down);
  const float angle = (along_row - ray).norm() / kBeside, median = rays[0].median_depth;
  const bool is_sky = !std::isfinite(median);
  if (is_sky && !scene_field.EndsAtInfinity()) return;
  const float t = is_sky ? kSkyDistance * scene_field.sampler_options.far : median;
  const auto joins = [&](const RenderedRay& other) {
    return std::abs(other.median_depth - median) <= kSteepest * kBeside * angle * median;
  };
  Vector3f normal = -ray;
  if (!is_sky && joins(rays[1]) && joins(rays[2])) {
    const Vector3f row = rays[1].median_depth * along_row - t * ray,
                   column = rays[2].median_depth * along_column - t * ray, across = row.cross(column);
    if (across.squaredNorm() > 0) normal = across.normalized();
    if (normal.dot(ray) > 0) normal = -normal;
  }
  const std::uint8_t* p = &dataset.pixels[chosen.pixel * static_cast<std::size_t>(dataset.channels)];
  const Vector3f origin(chosen.view->camera.RayThrough(chosen.x, chosen.y).origin), rgb(p[0], p[1], p[2]);
  points->push_back({origin + t * ray, normal, rgb / 255, t * angle});
}

}  // namespace

std::vector<SurfacePoint> FieldSurface(const SceneField& scene_field,
                                       const Dataset& dataset,
                                       std::size_t number,
                                       std::uint64_t seed,
                                       io::Workers* workers) {
  const PixelChoice choose(dataset, seed);
  std::vector<SurfacePoint> points;
  for (std::size_t begin = 0; begin < number; begin += kBatch) {
    std::vector<ChosenPixel> chosen;
    std::vector<CameraPixel> pixels;
    for (std::size_t i = begin; i < std::min(number, begin + kBatch); ++i) {
      const ChosenPixel& d = chosen.emplace_back(choose(i));
      pixels.push_back({&d.view->camera, d.x, d.y});
      pixels.push_back({&d.view->camera, d.x + d.right, d.y});
      pixels.push_back({&d.view->camera, d.x, d.y + d.down});
    }
    const std::vector<RenderedRay> rendered =
        RenderPixels(scene_field, pixels, 1, 1.f, workers, {}, RayValues::kDepths);
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      if (!dataset.ShowsSky(chosen[i].pixel))
        AddPoint(scene_field, dataset, chosen[i], &rendered[kRays * i], &points);
    }
  }
  return points;
}

}  // namespace nerf
