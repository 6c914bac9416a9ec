// Pictures as training data: alpha is kept straight, composites agree for every background, rays are unit
// vectors.
#include "nerf/data/dataset.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "io/base/error.h"
#include "io/base/random.h"
#include "io/image/mask.h"
#include "nerf/fields/scene_field.h"
#include "nerf/metrics/metrics.h"
#include "nerf/rendering/volume_rendering.h"
#include "nerf/steps/ray_batch.h"
#include "nerf/training/heldout_monitor.h"
#include "tests/support/files/picture_scene.h"
#include "tests/support/files/temp_dir.h"

namespace nerf {
namespace {

using tests::SceneOf;

// Every alpha with its own colour.
io::Image GradedAlpha() {
  io::Image image = io::MakeImage(16, 16, 4);
  for (int i = 0; i < 256; ++i) {
    std::uint8_t* p = image.Pixel(i % 16, i / 16);
    p[0] = static_cast<std::uint8_t>(i * 7), p[1] = static_cast<std::uint8_t>(255 - i), p[2] = 40;
    p[3] = static_cast<std::uint8_t>(i);
  }
  return image;
}

TEST(Dataset, KeepsStraightAlphaByteForByte) {
  const TempDir dir;
  const io::Image image = GradedAlpha();
  io::WriteImage(dir / "a.png", image);
  const Dataset dataset = LoadDataset(SceneOf({dir / "a.png"}, 16, 16), 1);
  EXPECT_EQ(dataset.channels, 4);
  EXPECT_EQ(dataset.pixels, image.data);
}

TEST(Dataset, PicturesOfAnotherSizeThanTheirCameraAreNamed) {
  const TempDir dir;
  io::WriteImage(dir / "a.png", GradedAlpha());
  EXPECT_ERROR(LoadDataset(SceneOf({dir / "a.png"}, 16, 8), 1),
               io::ExitCode::kBadInput,
               "a.png: is 16x16, its camera 16x8");
}

TEST(Dataset, NoPicturesAndMoreThanCanBeCountedAreRefused) {
  EXPECT_ERROR(LayOutDataset(SceneOf({}, 16, 16), 1, 0.5), io::ExitCode::kBadInput, "no pictures");
  EXPECT_ERROR(StoredChannels(SceneOf({}, 16, 16)), io::ExitCode::kBadInput, "no pictures");
  const std::vector<std::filesystem::path> many(43, "a.png");
  EXPECT_ERROR(LayOutDataset(SceneOf(many, 10'000, 10'000), 1, 0.5),
               io::ExitCode::kBadInput,
               "4300 million pixels; the limit is 4294");
}

TEST(Dataset, DropsAlphaOnlyWhereItIsOpaqueEverywhere) {
  const TempDir dir;
  io::Image opaque = io::MakeImage(8, 4, 4), rgb = io::MakeImage(8, 4, 3);
  for (std::size_t i = 0; i < opaque.data.size(); ++i)
    opaque.data[i] = i % 4 == 3 ? 255 : static_cast<std::uint8_t>(i);
  io::WriteImage(dir / "opaque.png", opaque);
  io::WriteImage(dir / "rgb.png", rgb);
  const Dataset dataset = LoadDataset(SceneOf({dir / "opaque.png", dir / "rgb.png"}, 8, 4), 2);
  EXPECT_EQ(dataset.channels, 3);
  ASSERT_EQ(dataset.n_pixels(), 64u);
  for (std::size_t i = 0; i < 32; ++i) EXPECT_EQ(dataset.pixels[3 * i + 1], opaque.data[4 * i + 1]);

  opaque.data[3] = 254;
  io::WriteImage(dir / "almost.png", opaque);
  EXPECT_EQ(LoadDataset(SceneOf({dir / "almost.png"}, 8, 4), 1).channels, 4);
  EXPECT_ERROR(LoadDataset(SceneOf({dir / "almost.png", dir / "rgb.png"}, 8, 4), 1),
               io::ExitCode::kBadInput,
               "rgb.png: has no alpha");
}

// A loader that forgets the background compares with other pictures altogether.
TEST(Dataset, TruthEqualsItsOwnCompositeAndNothingLikeItsColoursAlone) {
  const TempDir dir;
  io::Image image = GradedAlpha();
  for (std::size_t p = 0; p < image.data.size(); p += 4) {
    if (image.data[p + 3] < 200)
      image.data[p] = image.data[p + 1] = image.data[p + 2] = image.data[p + 3] = 0;
  }
  io::WriteImage(dir / "a.png", image);
  const io::Image truth = io::CompositeOn(io::ReadImage(dir / "a.png"), 255);
  EXPECT_EQ(PsnrFromMse(MeanSquaredError(truth, io::CompositeOn(image, 255))), kMaxPsnrDb);
  io::Image dropped = io::MakeImage(16, 16, 3);
  for (std::size_t i = 0; i < dropped.data.size(); ++i) dropped.data[i] = image.data[i / 3 * 4 + i % 3];
  EXPECT_LT(PsnrFromMse(MeanSquaredError(truth, dropped)), 3);
}

// Views of 20 x 15 pixels whose colours say which pixel of which view they are.
io::Image Numbered(int view) {
  io::Image image = io::MakeImage(20, 15, 3);
  for (int i = 0; i < 300; ++i) {
    image.data[static_cast<std::size_t>(3 * i)] = static_cast<std::uint8_t>(i % 256);
    image.data[static_cast<std::size_t>(3 * i) + 1] = static_cast<std::uint8_t>(i / 256);
    image.data[static_cast<std::size_t>(3 * i) + 2] = static_cast<std::uint8_t>(view);
  }
  return image;
}

// The first view has a mask with holes at both ends and within rows, the second none, the third one pixel.
struct MaskedViews {
  MaskedViews() : scene(SceneOf({dir / "0.png", dir / "1.png", dir / "2.png"}, 20, 15)) {
    for (int v = 0; v < 3; ++v)
      io::WriteImage(scene.frames[static_cast<std::size_t>(v)].image_path, Numbered(v));
    for (std::size_t i = 0; i < 300; ++i) masks[0].used[i] = i >= 7 && i < 290 && i % 5 != 0 ? 255 : 0;
    masks[2].used[299] = 255;
    for (const std::size_t v : {std::size_t{0}, std::size_t{2}}) {
      scene.frames[v].mask_path = dir / ("mask" + std::to_string(v) + ".png");
      io::WriteMask(scene.frames[v].mask_path, masks[v]);
    }
  }
  // By the number of the pixel in the data set.
  bool Uses(std::size_t pixel) const { return pixel / 300 == 1 || masks[pixel / 300].Uses(pixel % 300); }

  TempDir dir;
  io::Scene scene;
  std::array<io::Mask, 3> masks = {io::Mask{20, 15, std::vector<std::uint8_t>(300, 0)},
                                   io::Mask{20, 15, std::vector<std::uint8_t>(300, 0)},
                                   io::Mask{20, 15, std::vector<std::uint8_t>(300, 0)}};
};

TEST(Dataset, RanksCountTheUsedPixelsInOrder) {
  const MaskedViews views;
  const Dataset dataset = LoadDataset(views.scene, 2);
  std::size_t rank = 0;
  for (std::size_t pixel = 0; pixel < 900; ++pixel) {
    if (!views.Uses(pixel)) continue;
    ASSERT_LT(rank, dataset.n_used());
    EXPECT_EQ(dataset.UsedPixel(rank), pixel);
    ++rank;
  }
  EXPECT_EQ(rank, dataset.n_used());
  EXPECT_EQ(rank, 227u + 300 + 1);
}

TEST(Dataset, WithoutMasksOrWithWhiteOnesEveryPixelIsItsOwnRank) {
  MaskedViews views;
  for (const bool white : {false, true}) {
    for (io::Frame& frame : views.scene.frames) {
      frame.mask_path = white ? views.dir / "white.png" : std::filesystem::path();
      if (white) io::WriteMask(frame.mask_path, {20, 15, std::vector<std::uint8_t>(300, 255)});
    }
    const Dataset dataset = LoadDataset(views.scene, 1);
    EXPECT_EQ(dataset.runs.empty(), !white);
    ASSERT_EQ(dataset.n_used(), 900u);
    for (std::size_t rank = 0; rank < 900; ++rank) EXPECT_EQ(dataset.UsedPixel(rank), rank);
  }
}

TEST(Dataset, UsesThePixelsThatItIsTold) {
  const MaskedViews views;
  Dataset dataset = LoadDataset(views.scene, 1);
  const std::vector<bool> masked = dataset.UsedPixels();
  dataset.Use({});
  EXPECT_EQ(dataset.n_used(), 900u);
  EXPECT_TRUE(dataset.UsedPixels().empty());
  dataset.Use(masked);
  EXPECT_EQ(dataset.UsedPixels(), masked);
  EXPECT_EQ(dataset.n_used(), 227u + 300 + 1);
  dataset.Use(std::vector<bool>(900, false));
  EXPECT_EQ(dataset.n_used(), 0u);
}

TEST(Dataset, NothingIsKnownToBeEmptyWhereAMaskUsesNothing) {
  const TempDir dir;
  const io::Image image = GradedAlpha();
  io::WriteImage(dir / "a.png", image);
  io::Mask mask{16, 16, std::vector<std::uint8_t>(256, 255)};
  mask.used[3] = mask.used[200] = 0;
  io::WriteMask(dir / "mask.png", mask);
  io::Scene scene = SceneOf({dir / "a.png"}, 16, 16);
  scene.frames[0].mask_path = dir / "mask.png";
  const Dataset dataset = LoadDataset(scene, 1);
  for (std::size_t i = 0; i < 256; ++i)
    EXPECT_EQ(dataset.pixels[4 * i + 3], mask.Uses(i) ? image.data[4 * i + 3] : 255) << i;
}

TEST(Dataset, MasksThatDoNotFitAreNamed) {
  const MaskedViews views;
  io::WriteMask(views.scene.frames[0].mask_path, {15, 20, std::vector<std::uint8_t>(300, 255)});
  EXPECT_ERROR(LoadDataset(views.scene, 1), io::ExitCode::kBadInput, "mask0.png: the mask is 15x20");
}

// Rays tell by their colour which pixel they go through.
TEST(DrawRays, ComeFromUsedPixelsAloneAndFromAllOfThemAlike) {
  const MaskedViews views;
  const Dataset dataset = LoadDataset(views.scene, 1);
  const SceneContraction contraction = {{0, 0, 0}, 1.5f, true};
  const OccupancyGrid grid(64, contraction);
  const Sampler sampler({.near = 0.f, .far = 10, .step_size = 0.01f}, contraction, grid);
  constexpr int kRays = 100000, kShards = 16;
  const BatchPlan plan{.seed = 5, .step = 9, .n_rays = kRays, .n_shards = kShards};
  std::vector<int> counts(900, 0);
  int n_rays = 0;
  for (int shard = 0; shard < kShards; ++shard) {
    RayBatch batch;
    DrawRays(dataset, sampler, plan, shard, &batch);
    for (const BatchRay& ray : batch.rays) {
      const auto level = [&](int c) { return std::lround(255 * ray.target.premultiplied[c]); };
      const auto pixel = static_cast<std::size_t>(300 * level(2) + 256 * level(1) + level(0));
      ASSERT_TRUE(views.Uses(pixel)) << pixel;
      const Ray through = dataset.views[pixel / 300].camera.RayThrough(static_cast<int>(pixel % 300 % 20),
                                                                       static_cast<int>(pixel % 300 / 20));
      for (int i = 0; i < 3; ++i) ASSERT_EQ(ray.ray.direction[i], through.direction[i]) << pixel;
      ++counts[pixel];
      ++n_rays;
    }
  }
  EXPECT_EQ(n_rays, kRays);
  // Pearson's chi-square with 527 degrees of freedom has mean 527 and standard deviation sqrt(2 * 527); five
  // of them are passed by chance once in 10^6 seeds.
  const double expected = kRays / 528.0;
  double chi2 = 0;
  for (std::size_t pixel = 0; pixel < 900; ++pixel) {
    if (views.Uses(pixel)) chi2 += (counts[pixel] - expected) * (counts[pixel] - expected) / expected;
  }
  EXPECT_NEAR(chi2, 527, 5 * std::sqrt(2 * 527.0));
}

TEST(Monitor, JudgesUsedPixelsAlone) {
  MaskedViews views;
  // Used pixels of one colour, the others of another.
  for (std::size_t v = 0; v < 3; ++v) {
    io::Image image = io::MakeImage(20, 15, 3);
    for (std::size_t i = 0; i < image.data.size(); ++i)
      image.data[i] = views.Uses(300 * v + i / 3) ? 200 : static_cast<std::uint8_t>(i % 100);
    io::WriteImage(views.scene.frames[v].image_path, image);
  }
  EXPECT_NEAR(ConstantSquaredError(LoadDataset(views.scene, 1), 0.5), 0, 1e-12);
  io::Workers workers(1);
  const Dataset dataset = LoadDataset(views.scene, 1);
  views.scene.aabb = {Eigen::Vector3d::Constant(-1), Eigen::Vector3d::Constant(1)};
  for (io::Frame& frame : views.scene.frames) frame.world_from_cam.translation.z() = 4;
  std::string derivation;
  const auto field = MakeSceneField(
      views.scene, dataset, {.log2_hashmap_size = 10, .grid_resolution = 64}, 1, &workers, &derivation);
  const double masked = HeldoutMonitor(views.scene, 1, 0.5).Psnr(*field, &workers);
  for (const io::Frame& frame : views.scene.frames) {
    io::Image image = io::MakeImage(20, 15, 3);
    std::fill(image.data.begin(), image.data.end(), std::uint8_t{200});
    io::WriteImage(frame.image_path, image);
  }
  EXPECT_EQ(HeldoutMonitor(views.scene, 1, 0.5).Psnr(*field, &workers), masked);
  EXPECT_TRUE(std::isfinite(masked));
}

// C + T b = rgb a + (1 - a) b, with C premultiplied, is what both losses and the pictures mean.
TEST(Compositing, PremultipliedColourAndAlphaGiveTheTruthOnEveryBackground) {
  for (const float alpha : {0.f, 1.f / 255, 0.5f, 1.f}) {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
      io::Random random(seed, io::Stream::kInit, 0, 0);
      PixelTarget target = {{}, alpha}, composite = {{}, 1.f};
      const float shade = seed < 3 ? 0.5f * static_cast<float>(seed) : -1.f;  // black, grey, white, random
      float background[3], colour[3], straight[3];
      for (int j = 0; j < 3; ++j) {
        background[j] = shade >= 0 ? shade : random.Uniform();
        straight[j] = random.Uniform();
        colour[j] = target.premultiplied[j] = straight[j] * alpha;
        composite.premultiplied[j] = straight[j] * alpha + (1 - alpha) * background[j];
      }
      EXPECT_LE(RandomBackgroundLoss(colour, 1 - alpha, target).squared_error, 1e-12f);
      EXPECT_LE(FixedBackgroundLoss(colour, 1 - alpha, target, background).squared_error, 1e-12f);
      EXPECT_LE(FixedBackgroundLoss(colour, 1 - alpha, composite, background).squared_error, 1e-12f);
      if (alpha == 0.5f) {  // straight colours are as wrong as they look
        EXPECT_GE(FixedBackgroundLoss(straight, 1 - alpha, target, background).squared_error, 1e-6f);
      }
    }
  }
}

// Truncation would be off by half a level on average.
TEST(Compositing, PicturesAreCompositedToTheNearestLevelForEveryAlpha) {
  double bias = 0;
  int count = 0;
  for (const int background : {0, 127, 255}) {
    for (int alpha = 0; alpha < 256; ++alpha) {
      io::Image image = io::MakeImage(256, 1, 4);
      for (int v = 0; v < 256; ++v) {
        std::uint8_t* p = image.Pixel(v, 0);
        p[0] = p[1] = p[2] = static_cast<std::uint8_t>(v), p[3] = static_cast<std::uint8_t>(alpha);
      }
      const io::Image result = io::CompositeOn(image, static_cast<std::uint8_t>(background));
      for (int v = 0; v < 256; ++v, ++count) {
        const double exact = (v * alpha + (255 - alpha) * background) / 255.0,
                     error = result.Pixel(v, 0)[1] - exact;
        ASSERT_LE(std::fabs(error), 0.5 + 1e-9) << v << " " << alpha << " on " << background;
        bias += error;
      }
    }
  }
  EXPECT_LT(std::fabs(bias / count), 0.01);
}

}  // namespace
}  // namespace nerf
