#include "nerf/rendering/trained_field.h"

#include <algorithm>
#include <cmath>

#include "nerf/fields/checkpoint.h"
#include "nerf/rendering/ray_renderer.h"
#include "nerf/rendering/splat_mixing.h"

namespace nerf {
namespace {

// Rows of pixels whose rays are in memory together.
constexpr int kBandRows = 128;

class CheckpointTrainedField : public TrainedField {
 public:
  explicit CheckpointTrainedField(const std::filesystem::path& checkpoint) {
    scene_field_ = ReadCheckpoint(checkpoint, &state_);
  }

  RenderedView Render(const io::Camera& camera,
                      const io::Rigid3d& world_from_cam,
                      const RenderOptions& options) const override {
    RenderedView view = RenderField(FieldCamera(camera, options), world_from_cam, options);
    AddSplats(camera, world_from_cam, options, &view);
    return view;
  }

  io::Camera FieldCamera(const io::Camera& camera, const RenderOptions& options) const override {
    if (!ShowsSplats(options) || options.field_focal_px <= 0 || camera.fl_x <= options.field_focal_px)
      return camera;
    const double scale = options.field_focal_px / camera.fl_x;
    return io::ResizedCamera(camera,
                             std::max(1, static_cast<int>(std::lround(scale * camera.width))),
                             std::max(1, static_cast<int>(std::lround(scale * camera.height))));
  }

  void AddSplats(const io::Camera& camera,
                 const io::Rigid3d& world_from_cam,
                 const RenderOptions& options,
                 RenderedView* view) const override {
    if (!ShowsSplats(options)) return;
    io::Workers workers(options.threads);
    MixSplats(*scene_field_, camera, world_from_cam, options.limits.crop, &workers, view);
  }

  bool HasUnknownSpace() const override { return state_.channels != 4 && !scene_field_->background; }

  const Splats& splats() const override { return scene_field_->splats; }

  std::vector<float> NearSplatOpacity(const io::Camera& camera,
                                      const io::Rigid3d& world_from_cam,
                                      double distance,
                                      int threads) const override {
    const Splats near = SplatsWhere(scene_field_->splats, [&](const Eigen::Vector3d& middle) {
      return (middle - world_from_cam.translation).squaredNorm() < distance * distance;
    });
    if (near.size() == 0) return {};
    io::Workers workers(threads);
    std::vector<float> opacity = SplatRasteriser(&workers)
                                     .Render(near, SplatViewOf(*scene_field_, camera, world_from_cam))
                                     .transmittance;
    for (float& value : opacity) value = scene_field_->splat_share * (1 - value);
    return opacity;
  }

  std::array<float, 3> Background(const std::array<float, 3>& wanted) const override {
    return scene_field_->Background(state_.channels == 4, wanted);
  }

 private:
  bool ShowsSplats(const RenderOptions& options) const {
    return options.splats && !options.depth_only && std::isinf(options.limits.end) &&
           scene_field_->splats.size() > 0;
  }

  RenderedView RenderField(const io::Camera& camera,
                           const io::Rigid3d& world_from_cam,
                           const RenderOptions& options) const {
    const RayCamera ray_camera(camera, world_from_cam, scene_field_->field->pixel_offset());
    io::Workers workers(options.threads);
    RenderedView view{.width = camera.width, .height = camera.height, .rgb = {}, .depth = {}, .opacity = {}};
    const int samples_per_pixel =
        options.samples_per_pixel > 0 ? options.samples_per_pixel : scene_field_->samples_per_pixel;
    const float step_scale =
        scene_field_->step_scale *
        (options.step_scale > 0 ? options.step_scale : FinestStepScale(samples_per_pixel));
    const std::array<float, 3> background =
        options.limits.crop ? options.background : Background(options.background);
    const std::size_t n = static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height);
    view.rgb.reserve(3 * n), view.depth.reserve(n), view.median_depth.reserve(n), view.opacity.reserve(n);
    view.unlearnt.reserve(n);
    const RayValues values = options.depth_only ? RayValues::kDepths : RayValues::kColours;
    std::vector<CameraPixel> band;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) band.push_back({&ray_camera, x, y});
      if ((y + 1) % kBandRows != 0 && y + 1 < camera.height) continue;
      for (const RenderedRay& ray : RenderPixels(
               *scene_field_, band, samples_per_pixel, step_scale, &workers, options.limits, values)) {
        for (std::size_t j = 0; j < 3; ++j) {
          view.rgb.push_back(std::clamp(ray.rgb[j] + ray.transmittance * background[j], 0.f, 1.f));
        }
        view.depth.push_back(ray.depth);
        view.median_depth.push_back(ray.median_depth);
        view.opacity.push_back(1.f - ray.transmittance);
        view.unlearnt.push_back(ray.unlearnt);
      }
      band.clear();
    }
    return view;
  }

  TrainState state_;
  std::unique_ptr<SceneField> scene_field_;
};

}  // namespace

std::size_t LoadedFieldBytes(const std::filesystem::path& checkpoint) {
  // Values and moments are 5 to 12 bytes of a tensor's value in the file, its rounded copy is 2 more.
  constexpr double kCopies = 1.4;
  constexpr std::size_t kGridBytes = std::size_t{32} << 20;
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(checkpoint, error);
  return error ? kGridBytes : static_cast<std::size_t>(kCopies * static_cast<double>(bytes)) + kGridBytes;
}

std::size_t RenderingBytes(const io::Camera& camera, int samples_per_pixel) {
  // 28 of the view, 28 of the splats before it and their blurred picture, 12 of a picture while it is
  // encoded.
  constexpr std::size_t kPerPixel = 68;
  constexpr std::size_t kPerRay = sizeof(Ray) + 2 * sizeof(RenderedRay) + sizeof(CameraPixel);
  const auto width = static_cast<std::size_t>(camera.width), height = static_cast<std::size_t>(camera.height);
  const auto rays = static_cast<std::size_t>(samples_per_pixel);
  return kPerPixel * width * height + kPerRay * rays * width * std::min<std::size_t>(kBandRows, height);
}

std::unique_ptr<TrainedField> TrainedField::Load(const std::filesystem::path& checkpoint) {
  return std::make_unique<CheckpointTrainedField>(checkpoint);
}

}  // namespace nerf
