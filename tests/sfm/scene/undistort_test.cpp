// Undistortion against a picture whose every pixel is known in closed form.
#include "sfm/scene/undistort.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <utility>

#include "io/base/error.h"
#include "io/image/image.h"
#include "io/image/mask.h"

namespace {

namespace fs = std::filesystem;

class Undistort : public testing::Test {
 protected:
  Undistort() {
    std::string name = (fs::temp_directory_path() / "undistort_XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~Undistort() override { fs::remove_all(folder_); }
  fs::path folder_;
};

io::Camera LensCamera(double k1) {
  return {.width = 160,
          .height = 120,
          .fl_x = 130,
          .fl_y = 132,
          .cx = 83,
          .cy = 58,
          .k1 = k1,
          .k2 = 0.02,
          .p1 = 1e-3,
          .p2 = -1e-3};
}

// Smooth waves over the directions of rays, sampled at pixel centres.
io::Image Render(const io::Camera& camera, int channels = 3) {
  io::Image image = io::MakeImage(camera.width, camera.height, channels);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = *io::RayFromImg(camera, {x + 0.5, y + 0.5});
      const double u = ray.x() / -ray.z(), v = ray.y() / -ray.z();
      std::uint8_t* pixel = image.Pixel(x, y);
      pixel[0] = static_cast<std::uint8_t>(std::lround(128 + 100 * std::sin(20 * u) * std::cos(17 * v)));
      pixel[1] = static_cast<std::uint8_t>(std::lround(128 + 100 * std::sin(12 * u + 9 * v)));
      pixel[2] = static_cast<std::uint8_t>(std::lround(128 + 100 * std::cos(25 * v)));
      if (channels == 4) pixel[3] = u < 0 ? 255 : 128;
    }
  }
  return image;
}

double MeanDifference(const io::Image& a, const io::Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) sum += std::abs(a.data[i] - b.data[i]);
  return sum / static_cast<double>(a.data.size());
}

TEST_F(Undistort, EqualsThePictureOfThePinholeCamera) {
  for (const double k1 : {-0.25, 0.15}) {
    const io::Camera camera = LensCamera(k1);
    io::WriteImage(folder_ / "a.png", Render(camera));
    const io::Scene scene{.cameras = {camera}, .frames = {{.image_path = folder_ / "a.png"}}};
    const io::Scene result = sfm::UndistortScene(scene, folder_ / "out", 2);
    const io::Camera& pinhole = result.cameras[0];
    EXPECT_FALSE(pinhole.HasDistortion());
    EXPECT_EQ(pinhole.cx, 80);
    EXPECT_EQ(pinhole.cy, 60);
    const io::Image expected = Render(pinhole), actual = io::ReadImage(result.frames[0].image_path);
    ASSERT_EQ(actual.width, 160);
    // Half a pixel of shift makes this more than 2 grey levels.
    EXPECT_LT(MeanDifference(actual, expected), 0.6) << k1;
    EXPECT_GT(MeanDifference(Render(camera), expected), 5) << k1;
  }
}

TEST_F(Undistort, NoPixelComesFromOutsideAndTheFieldOfViewIsTheWidest) {
  for (const double k1 : {-0.25, 0.15}) {
    const io::Camera camera = LensCamera(k1), pinhole = sfm::PinholeCamera(camera);
    double nearest = 1e9;  // distance of the source border, over the target border
    for (int i = 0; i <= 1000; ++i) {
      const double x = 160 * i / 1000.0, y = 120 * i / 1000.0;
      for (const Eigen::Vector2d& xy : {Eigen::Vector2d(x, 0), {x, 120}, {0, y}, {160, y}}) {
        const Eigen::Vector2d source = *io::ImgFromCam(camera, *io::RayFromImg(pinhole, xy));
        nearest = std::min({nearest, source.x(), 160 - source.x(), source.y(), 120 - source.y()});
      }
    }
    EXPECT_GT(nearest, -0.01) << k1;
    EXPECT_LT(nearest, 0.5) << k1;
  }
}

TEST_F(Undistort, PicturesWithoutDistortionAreCopiedByteForByte) {
  const io::Camera camera{.width = 160, .height = 120, .fl_x = 130, .fl_y = 130, .cx = 70, .cy = 60};
  io::WriteImage(folder_ / "a.jpg", Render(camera));
  const io::Scene scene{.cameras = {camera}, .frames = {{.image_path = folder_ / "a.jpg"}}};
  const io::Scene result = sfm::UndistortScene(scene, folder_ / "out", 1);
  EXPECT_EQ(result.cameras[0].cx, 70);
  EXPECT_EQ(result.frames[0].image_path.filename(), "a.jpg");
  const auto bytes = [](const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  EXPECT_EQ(bytes(folder_ / "a.jpg"), bytes(result.frames[0].image_path));
}

TEST_F(Undistort, SeveralCamerasAlphaAndEqualNames) {
  const io::Camera first = LensCamera(-0.2);
  const io::Camera second = io::ResizedCamera(LensCamera(0.1), 80, 60);
  fs::create_directories(folder_ / "x");
  fs::create_directories(folder_ / "y");
  io::WriteImage(folder_ / "x" / "1.png", Render(first));
  io::WriteImage(folder_ / "y" / "1.png", Render(second, 4));
  const io::Scene scene{.cameras = {first, second},
                        .frames = {{.image_path = folder_ / "x" / "1.png", .camera_index = 0},
                                   {.image_path = folder_ / "y" / "1.png", .camera_index = 1}}};
  const io::Scene result = sfm::UndistortScene(scene, folder_ / "out", 2);
  EXPECT_EQ(result.frames[0].image_path.filename(), "1.png");
  EXPECT_EQ(result.frames[1].image_path.filename(), "1_2.png");
  const io::Image image = io::ReadImage(result.frames[1].image_path);
  ASSERT_EQ(image.channels, 4);
  EXPECT_LT(MeanDifference(image, Render(result.cameras[1], 4)), 2.0);
}

// A disc around the optical axis, by the tangents of the rays at pixel centres.
io::Mask Disc(const io::Camera& camera, double radius) {
  io::Mask mask{camera.width, camera.height, {}};
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = *io::RayFromImg(camera, {x + 0.5, y + 0.5});
      mask.used.push_back(std::hypot(ray.x(), ray.y()) < -ray.z() * radius ? 255 : 0);
    }
  }
  return mask;
}

TEST_F(Undistort, MasksFollowTheirPictures) {
  for (const double k1 : {-0.25, 0.15}) {
    const io::Camera camera = LensCamera(k1);
    constexpr double kRadius = 0.3;
    io::WriteImage(folder_ / "a.jpg", Render(camera));
    io::WriteImage(folder_ / "b.png", Render(camera));
    io::WriteImage(folder_ / "c.png", Render(camera));
    io::WriteMask(folder_ / "disc.png", Disc(camera, kRadius));
    io::WriteMask(folder_ / "white.png", Disc(camera, 100));
    const io::Scene scene{.cameras = {camera},
                          .frames = {{.image_path = folder_ / "a.jpg", .mask_path = folder_ / "disc.png"},
                                     {.image_path = folder_ / "b.png", .mask_path = folder_ / "white.png"},
                                     {.image_path = folder_ / "c.png"}}};
    const io::Scene result = sfm::UndistortScene(scene, folder_ / "out", 2);
    EXPECT_EQ(result.frames[0].image_path, folder_ / "out/images/a.png");
    EXPECT_EQ(result.frames[0].mask_path, folder_ / "out/masks/a.png");
    EXPECT_EQ(result.frames[2].mask_path, "");
    const io::Camera& pinhole = result.cameras[0];
    const io::Mask disc = io::ReadMask(result.frames[0].mask_path, 160, 120);
    // The nearest pixel's centre is at most 0.71 source pixels away; the lens stretches them by less than
    // 1.3, and 1 / 130 is a pixel's tangent.
    const double margin = 0.71 * 1.3 / 130;
    const io::Mask inner = Disc(pinhole, kRadius - margin), outer = Disc(pinhole, kRadius + margin);
    int n_certain = 0;
    for (std::size_t p = 0; p < disc.used.size(); ++p) {
      if (inner.Uses(p) != outer.Uses(p)) continue;
      EXPECT_EQ(disc.Uses(p), inner.Uses(p)) << p;
      ++n_certain;
    }
    EXPECT_GT(n_certain, 160 * 120 * 9 / 10);
    EXPECT_EQ(io::ReadMask(result.frames[1].mask_path, 160, 120).UsedCount(), 160u * 120);
    EXPECT_NE(Disc(camera, kRadius).used, Disc(pinhole, kRadius).used);
  }
}

TEST_F(Undistort, MasksOfPinholePicturesStayAndWrongOnesAreNamed) {
  const io::Camera camera{.width = 160, .height = 120, .fl_x = 130, .fl_y = 130, .cx = 70, .cy = 60};
  io::WriteImage(folder_ / "a.jpg", Render(camera));
  io::WriteMask(folder_ / "disc.png", Disc(camera, 0.2));
  io::Scene scene{.cameras = {camera},
                  .frames = {{.image_path = folder_ / "a.jpg", .mask_path = folder_ / "disc.png"}}};
  const io::Scene result = sfm::UndistortScene(scene, folder_ / "out", 1);
  EXPECT_EQ(io::ReadMask(result.frames[0].mask_path, 160, 120).used, Disc(camera, 0.2).used);
  scene.frames[0].mask_path = folder_ / "small.png";
  io::WriteMask(scene.frames[0].mask_path, {2, 1, {255, 255}});
  try {
    sfm::UndistortScene(scene, folder_ / "out", 1);
    FAIL();
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kBadInput);
    for (const char* name : {"small.png", "mask is 2x1"}) {
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
    }
  }
}

TEST_F(Undistort, FaultsAreNamed) {
  const io::Camera camera = LensCamera(-0.25);
  io::WriteImage(folder_ / "small.png", io::MakeImage(10, 10, 3));
  const auto message = [&](const io::Camera& with, const std::string& name) -> std::string {
    try {
      sfm::UndistortScene(
          {.cameras = {with}, .frames = {{.image_path = folder_ / name}}}, folder_ / "out", 2);
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), io::ExitCode::kBadInput);
      return error.what();
    }
    return "";
  };
  for (const char* part : {"small.png", "is 10x10", "camera is 160x120"}) {
    EXPECT_NE(message(camera, "small.png").find(part), std::string::npos) << part;
  }
  EXPECT_NE(message(camera, "absent.png").find("absent.png"), std::string::npos);
  io::Camera folding = camera;
  folding.k1 = -1.5;
  for (const char* part : {"k1 -1.5", "folds back"}) {
    EXPECT_NE(message(folding, "small.png").find(part), std::string::npos) << part;
  }
  io::Camera beside = camera;
  beside.k1 = 0.01, beside.k2 = 0;
  for (const double share : {-0.5, 1.5}) {
    for (double* centre : {&beside.cx, &beside.cy}) {
      const double kept = std::exchange(*centre, share * camera.width);
      EXPECT_NE(message(beside, "small.png").find("principal point lies outside"), std::string::npos)
          << share;
      *centre = kept;
    }
  }
}

}  // namespace
