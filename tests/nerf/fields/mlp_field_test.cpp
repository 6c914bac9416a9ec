// The trained `nerf` field: ways of sampling it agree, a plain renderer in double agrees, and its checkpoint
// makes it again.
#include <cstring>

#include "io/base/error.h"
#include "nerf/rendering/ray_renderer.h"
#include "nerf/rendering/volume_rendering.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/field_tensor.h"
#include "tests/support/scenes/reference_mlp.h"
#include "tests/support/scenes/small_mlp.h"

namespace nerf {
namespace {

using tests::FieldOf;
using tests::TensorOf;

// A ball after a few dozen steps; the tests differ in how they look at it.
class TrainedBall : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    const TempDir dir;
    const io::Scene scene = tests::SmallBall(dir.path(), 12, 0, tests::kPrunedFar);
    Train(scene, {}, tests::SmallMlp(60, 256), dir.path());
    TrainState state;
    trained_ = ReadCheckpoint(dir.path() / "checkpoint.bin", &state);
    const RayCamera camera(scene.cameras[0], scene.frames[0].world_from_cam);
    for (int i = 0; i < kRays; ++i) rays_.push_back(camera.RayThrough(8 + i % 8, 8 + i / 8));
  }
  static void TearDownTestSuite() { trained_.reset(), rays_.clear(); }

  // The same network (twice, where there are two) with another quadrature on [3.25, 4.75]: all of it lies
  // within the cube of the scene's contraction, where the pruned rays end.
  static std::unique_ptr<SceneField> With(const QuadratureOptions& quadrature) {
    FieldConfig config = trained_->field->Config();
    config["samples"] = quadrature.n_samples;
    config["importance_samples"] = quadrature.n_importance;
    config["open_end"] = quadrature.open_end;
    auto field = std::make_unique<MlpField>(config);
    const std::span<float> weights = TensorOf(trained_->field.get(), "weights"),
                           copy = TensorOf(field.get(), "weights");
    for (std::size_t i = 0; i < copy.size(); ++i) copy[i] = weights[i % weights.size()];
    field->Refresh();
    SamplerOptions sampling = trained_->sampler_options;
    sampling.near = 3.25f, sampling.far = 4.75f;
    auto result = std::make_unique<SceneField>(trained_->contraction, sampling, std::move(field), 64);
    result->grid.density() = trained_->grid.density();
    result->grid.distance() = trained_->grid.distance();
    result->grid.Refresh();
    return result;
  }

  // Colours on white [kRays][3].
  static std::vector<double> Render(const SceneField& scene_field, float step_scale) {
    io::Workers workers(2);
    std::vector<double> colours;
    for (const RenderedRay& ray : RenderRays(scene_field, rays_, 1, step_scale, &workers)) {
      for (const float c : ray.rgb) colours.push_back(c + ray.transmittance);
    }
    return colours;
  }

  static constexpr int kRays = 64;
  static std::unique_ptr<SceneField> trained_;
  static std::vector<Ray> rays_;
};
std::unique_ptr<SceneField> TrainedBall::trained_;
std::vector<Ray> TrainedBall::rays_;

double Psnr(const std::vector<double>& a, const std::vector<double>& b, double* largest) {
  EXPECT_EQ(a.size(), b.size());
  double sum = 0;
  *largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += (a[i] - b[i]) * (a[i] - b[i]);
    *largest = std::max(*largest, std::fabs(a[i] - b[i]));
  }
  return -10 * std::log10(sum / static_cast<double>(a.size()));
}

// Marks as occupied what the field itself has on the rays, also outside of all masks, where it was never
// trained.
void Occupy(const std::vector<Ray>& rays, SceneField* scene_field) {
  OccupancyGrid& grid = scene_field->grid;
  for (std::uint32_t cell = 0; cell < grid.n_cells(); ++cell) grid.SetCandidate(cell);
  grid.Forget();
  const Sampler sampler(scene_field->sampler_options, scene_field->contraction, grid);
  std::vector<float> t, delta, sigma;
  StratifiedDistances(scene_field->sampler_options.near, scene_field->sampler_options.far, 256, nullptr, &t);
  delta.resize(t.size());
  for (const Ray& ray : rays) {
    Samples samples;
    sampler.Place(ray, t, delta, &samples);
    sigma.resize(t.size());
    scene_field->field->QueryDensity(samples, sigma.data());
    for (std::size_t i = 0; i < t.size(); ++i) grid.Visit(samples.cell[i], sigma[i]);
  }
  grid.Rebuild();
}

TEST_F(TrainedBall, DepthsAloneAreThoseOfTheWholePicture) {
  io::Workers workers(2);
  const std::unique_ptr<SceneField> stratified = With({.n_samples = 64, .n_importance = 32}),
                                    pruned = With({});
  for (const SceneField* field : {stratified.get(), pruned.get()}) {
    const std::vector<RenderedRay> whole = RenderRays(*field, rays_, 1, 0.2f, &workers),
                                   depths =
                                       RenderRays(*field, rays_, 1, 0.2f, &workers, {}, RayValues::kDepths);
    for (std::size_t i = 0; i < rays_.size(); ++i) {
      EXPECT_EQ(depths[i].transmittance, whole[i].transmittance) << i;
      EXPECT_EQ(depths[i].depth, whole[i].depth) << i;
      for (const float c : depths[i].rgb) EXPECT_EQ(c, 0.f) << i;
    }
  }
}

TEST_F(TrainedBall, MedianDepthIsTheSameByBothQuadratures) {
  io::Workers workers(2);
  const auto rays = [&](const SceneField& scene_field) {
    return RenderRays(scene_field, rays_, 1, 0.2f, &workers);
  };
  const std::unique_ptr<SceneField> pruned_field = With({});
  Occupy(rays_, pruned_field.get());
  const std::vector<RenderedRay> pruned = rays(*pruned_field);
  for (const bool open_end : {false, true}) {
    const std::vector<RenderedRay> stratified = rays(*With({.n_samples = 512, .open_end = open_end}));
    int n = 0;
    for (std::size_t i = 0; i < pruned.size(); ++i) {
      if (std::abs(pruned[i].transmittance - 0.5f) < 0.2f) continue;  // on the verge
      EXPECT_EQ(std::isfinite(pruned[i].median_depth), pruned[i].transmittance < 0.5f);
      if (pruned[i].transmittance > 0.5f) continue;
      EXPECT_NEAR(stratified[i].median_depth, pruned[i].median_depth, 0.02) << i;
      ++n;
    }
    EXPECT_GT(n, 10);
  }
}

TEST_F(TrainedBall, LooksTheSameWithEverySampling) {
  double largest;
  const std::vector<double> dense = Render(*With({.n_samples = 256}), 1);
  const auto check = [&](const char* name, const SceneField& scene_field, double db) {
    const double psnr = Psnr(Render(scene_field, 0.25f), dense, &largest);
    std::printf("%s: %.1f dB from 256 stratified samples, at most %.1e\n", name, psnr, largest);
    EXPECT_GE(psnr, db) << name;
  };
  check("stratified, 64 samples", *With({.n_samples = 64}), 35);
  check("importance, 32 + 64 samples", *With({.n_samples = 32, .n_importance = 64}), 40);
  // A skipped cell hides up to 3 % of the light that crosses it.
  const auto pruned = With({});
  Occupy(rays_, pruned.get());
  std::printf("%.1f %% of the cells are occupied\n", 100 * pruned->grid.OccupiedShare());
  EXPECT_LT(pruned->grid.OccupiedShare(), 0.5);
  check("occupied cells", *pruned, 30);
}

// The picture of a ray in double from the paper's formulas: stratified midpoints, closed ends.
void RenderExactly(const tests::ReferenceMlp<double>& mlp,
                   const SceneField& scene_field,
                   const MlpFieldOptions& options,
                   const Ray& ray,
                   std::vector<double>* colours) {
  const SceneContraction& contraction = scene_field.contraction;
  const double near = scene_field.sampler_options.near, far = scene_field.sampler_options.far;
  const int n = options.quadrature.n_samples;
  const double direction[3] = {ray.direction[0], ray.direction[1], ray.direction[2]};
  std::vector<double> direction_code(static_cast<std::size_t>(EncodedSize(options.direction))),
      position_code(static_cast<std::size_t>(EncodedSize(options.position)));
  PositionalEncoding(options.direction, direction, direction_code.data());
  double colour[3] = {}, depth = 0;
  for (int i = 0; i < n; ++i) {
    const double delta = (far - near) / n, t = near + (i + 0.5) * delta;
    double p[3];
    for (std::size_t j = 0; j < 3; ++j)
      p[j] = std::clamp(
          (ray.origin[j] + t * direction[j] - contraction.centre[j]) / contraction.half, -1.0, 1.0);
    PositionalEncoding(options.position, p, position_code.data());
    const auto row = mlp.Forward(position_code, direction_code);
    const double tau = std::log1p(std::exp(row.density - 1)) * delta;
    for (std::size_t j = 0; j < 3; ++j)
      colour[j] += std::exp(-depth) * -std::expm1(-tau) / (1 + std::exp(-row.logits[j]));
    depth += tau;
  }
  for (const double c : colour) colours->push_back(c + std::exp(-depth));
}

TEST_F(TrainedBall, LooksTheSameInDouble) {
  const auto scene_field = With({.n_samples = 24});
  const MlpField& field = FieldOf(scene_field.get());
  const std::span<float> weights = TensorOf(scene_field->field.get(), "weights");
  const tests::ReferenceMlp<double> mlp(MlpOptionsOf(field.options()), {weights.begin(), weights.end()});
  std::vector<double> exact, ours = Render(*scene_field, 1);
  for (const Ray& ray : rays_) RenderExactly(mlp, *scene_field, field.options(), ray, &exact);
  double largest;
  const double psnr = Psnr(ours, exact, &largest);
  std::printf("float renderer: %.1f dB from double, at most %.1e\n", psnr, largest);
  EXPECT_GE(psnr, 90);
  EXPECT_LE(largest, 2e-4);
}

TEST(MlpField, ItsConfigMakesItAgain) {
  MlpFieldOptions options = ReportTrainOptions().field.mlp;
  options.quadrature.n_importance = 8;
  const MlpField field(options, true, 1);
  EXPECT_EQ(field.n_networks(), 2);
  EXPECT_EQ(field.n_parameters(), 2 * 595844u);
  const MlpField again(field.Config());
  EXPECT_EQ(again.Config(), field.Config());
  EXPECT_EQ(again.n_parameters(), field.n_parameters());
  EXPECT_EQ(again.pixel_offset(), 0.0);
  for (const auto& [key, value] : field.Config()) {
    if (key == "contracted") continue;
    FieldConfig config = field.Config();
    config[key] = -1;
    EXPECT_ERROR(MlpField{config}, io::ExitCode::kBadState, key);
    config.erase(key);
    EXPECT_ERROR(MlpField{config}, io::ExitCode::kBadState, key);
  }
}

}  // namespace
}  // namespace nerf
