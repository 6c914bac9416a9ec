// Pictures as training data: alpha is kept straight, composites agree for every background, rays are unit
// vectors.
#include "nerf/dataset.h"

#include <cmath>

#include "io/error.h"
#include "nerf/metrics.h"
#include "nerf/random.h"
#include "nerf/volume_rendering.h"
#include "tests/temp_dir.h"

namespace nerf {
namespace {

io::Scene SceneOf(const std::vector<std::filesystem::path>& pictures, int width, int height) {
  io::Scene scene;
  io::Camera camera;
  camera.width = width, camera.height = height;
  camera.fl_x = camera.fl_y = 1.2 * width;
  camera.cx = 0.5 * width, camera.cy = 0.5 * height;
  scene.cameras.push_back(camera);
  for (const auto& path : pictures) {
    io::Frame frame;
    frame.image_path = path;
    scene.frames.push_back(frame);
  }
  return scene;
}

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

// N12
TEST(Dataset, KeepsStraightAlphaByteForByte) {
  const TempDir dir;
  const io::Image image = GradedAlpha();
  io::WriteImage(dir / "a.png", image);
  const Dataset dataset = LoadDataset(SceneOf({dir / "a.png"}, 16, 16), 1);
  EXPECT_EQ(dataset.channels, 4);
  EXPECT_EQ(dataset.pixels, image.data);
}

// N12
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

// N12: a loader that forgets the background compares with other pictures altogether.
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

// N11: C + T b = rgb a + (1 - a) b, with C premultiplied, is what both losses and the pictures mean.
TEST(Compositing, PremultipliedColourAndAlphaGiveTheTruthOnEveryBackground) {
  for (const float alpha : {0.f, 1.f / 255, 0.5f, 1.f}) {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
      Random random(seed, Stream::kInit, 0, 0);
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

// N11, N45: truncation would be off by half a level on average.
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

// N10: distances along a ray are scene units whatever the focal length, so lengths need no factor.
TEST(RayCamera, DirectionsAreUnitVectorsForAnyFocalLength) {
  io::Rigid3d world_from_cam;
  world_from_cam.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  for (const double scale : {0.1, 0.3, 1.0, 3.0, 10.0}) {
    io::Camera camera;
    camera.width = 64, camera.height = 48;
    camera.fl_x = 64 * scale, camera.fl_y = 50 * scale;
    camera.cx = 31, camera.cy = 25;
    const RayCamera rays(camera, world_from_cam);
    for (int y = 0; y < 48; y += 47) {
      for (int x = 0; x < 64; x += 7) {
        double squared = 0;
        for (const float d : rays.RayThrough(x, y).direction) squared += double{d} * double{d};
        EXPECT_NEAR(std::sqrt(squared), 1, 1e-6) << scale;
      }
    }
  }
}

}  // namespace
}  // namespace nerf
