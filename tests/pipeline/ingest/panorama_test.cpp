// Panoramas of 360 degrees are told from other pictures, and views of pinhole cameras take their places.
#include "pipeline/ingest/panorama.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/files/ingest_fixture.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/textured_room.h"

namespace {

constexpr int kPanorama = 512;
const Eigen::Vector3d kCentre(0.3, 0.1, -0.4);

// The middle of a panorama looks along +z, and longitude grows to the right.
Eigen::Vector3d Ray(double longitude, double latitude) {
  return {std::sin(longitude) * std::cos(latitude),
          -std::sin(latitude),
          std::cos(longitude) * std::cos(latitude)};
}

io::Image Panorama(int width = kPanorama) {
  return textured_room::Photo(width, width / 2, kCentre, [=](double x, double y) {
    const double per_radian = width / (2 * std::numbers::pi);
    return Ray((x - width / 2.) / per_radian, (width / 4. - y) / per_radian);
  });
}

// What a pinhole camera shows that looks `degrees` to the right of the panorama's middle.
io::Image PinholeView(const pipeline::PanoramaViews& views, double degrees) {
  const double longitude = degrees * std::numbers::pi / 180;
  return textured_room::Photo(views.width(), views.height(), kCentre, [&](double x, double y) {
    const double right = (x - views.width() / 2.) / views.focal_px(),
                 down = (y - views.height() / 2.) / views.focal_px();
    const Eigen::Vector3d forward = Ray(longitude, 0), across(forward.z(), 0, -forward.x());
    return Eigen::Vector3d((forward + right * across + down * Eigen::Vector3d::UnitY()).normalized());
  });
}

double MeanDifference(const io::Image& a, const io::Image& b) {
  EXPECT_EQ(a.data.size(), b.data.size());
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) sum += std::abs(a.data[i] - b.data[i]);
  return sum / static_cast<double>(a.data.size());
}

TEST(Panorama, IsToldFromOtherWidePictures) {
  const io::Image panorama = Panorama();
  EXPECT_TRUE(pipeline::IsPanorama(panorama));
  EXPECT_TRUE(pipeline::IsPanorama(io::ResizeArea(panorama, 400, 201))) << "rounded sides";
  EXPECT_FALSE(pipeline::IsPanorama(io::ResizeArea(panorama, 400, 230))) << "shape";
  const pipeline::PanoramaViews views(2048, 1024, 10000);
  io::Image photo = PinholeView(views, 90);
  photo.height = photo.width / 2;
  photo.data.resize(static_cast<std::size_t>(3 * photo.width * photo.height));
  EXPECT_FALSE(pipeline::IsPanorama(photo)) << "a photo that is twice as wide as high";
  for (int y = 0; y < photo.height / 4; ++y)  // below a plain sky
    std::fill_n(photo.Pixel(0, y), 3 * photo.width, std::uint8_t{220});
  EXPECT_FALSE(pipeline::IsPanorama(photo)) << "its borders do not meet";
  io::Image tapestry = io::MakeImage(512, 256, 3);
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 512; ++x) {
      const double wave = std::sin(2 * std::numbers::pi * 8 * x / 512 + 1) * std::cos(0.05 * y);
      std::fill_n(tapestry.Pixel(x, y), 3, static_cast<std::uint8_t>(128 + 90 * wave));
    }
  }
  EXPECT_FALSE(pipeline::IsPanorama(tapestry)) << "its borders meet, but it has no pole";
  io::Image product = io::MakeImage(512, 256, 3);
  std::fill(product.data.begin(), product.data.end(), std::uint8_t{255});
  for (int y = 80; y < 200; ++y) std::fill_n(product.Pixel(150, y), 3 * 200, static_cast<std::uint8_t>(y));
  EXPECT_FALSE(pipeline::IsPanorama(product)) << "a plain backdrop";
  EXPECT_FALSE(pipeline::IsPanorama(io::MakeImage(512, 256, 3))) << "black";
}

TEST(Panorama, ViewsAreThoseOfPinholeCamerasAroundTheHorizon) {
  const io::Image panorama = Panorama(1024);
  const pipeline::PanoramaViews views(1024, 512, 10000);
  EXPECT_NEAR(views.focal_px(), 1024 / (2 * std::numbers::pi), 1e-9);
  EXPECT_NEAR(views.width() / (2 * views.focal_px()), std::tan(40 * std::numbers::pi / 180), 0.01);
  EXPECT_NEAR(views.height() / (2 * views.focal_px()), std::tan(50 * std::numbers::pi / 180), 0.01);
  for (int i = 0; i < pipeline::PanoramaViews::kCount; ++i) {
    const io::Image view = views.Of(panorama, i);
    EXPECT_LT(MeanDifference(view, PinholeView(views, 60 * i)),
              0.4 * MeanDifference(view, PinholeView(views, 60 * i + 2)))
        << i;
  }
}

TEST(Panorama, ViewsAreNoLargerThanAskedAndAPanoramaOfThatWidthHasTheirScale) {
  const int width = pipeline::PanoramaWidth(300);
  const pipeline::PanoramaViews small(4096, 2048, 300), same(width, width / 2, 300);
  EXPECT_LE(small.height(), 300);
  EXPECT_GE(small.height(), 299);
  EXPECT_EQ(same.height(), small.height());
  EXPECT_NEAR(same.focal_px(), width / (2 * std::numbers::pi), 0.01 * same.focal_px());
}

TEST_F(Ingest, PanoramasBecomeViewsInTheOrderOfTheWalk) {
  const io::Image panorama = Panorama(1024);
  const cv::Mat rgb(512, 1024, CV_8UC3, const_cast<std::uint8_t*>(panorama.data.data()));
  for (int i = 0; i < 3; ++i) {
    const cv::Mat stamped = rgb.clone();  // photos that show the same would be left out
    stamped(cv::Rect(300 + 100 * i, 200, 90, 90)).setTo(cv::Scalar::all(255));
    WritePhoto("p" + std::to_string(9 + i) + ".jpg", stamped);
  }
  ASSERT_EQ(Run(photos(), {"--max-size", "300"}), 0) << message_;
  EXPECT_NE(message_.find("3 panoramas of 360 degrees: 18 views"), std::string::npos) << message_;
  const auto& kept = frames_["kept"];
  ASSERT_EQ(kept.size(), 18u);
  EXPECT_EQ(kept[0]["name"], "view1_p9.png");
  EXPECT_EQ(kept[1]["name"], "view1_p10.png");
  EXPECT_EQ(kept[17]["name"], "view6_p11.png");
  std::size_t n_files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(run() / "ingest" / "images")) {
    const io::Image image = io::ReadImage(entry.path());
    EXPECT_NEAR(std::max(image.width, image.height), 299.5, 0.6)
        << "of the large panorama, not of one of 300";
    ++n_files;
  }
  EXPECT_EQ(n_files, 18u);
  EXPECT_NEAR(kept[5]["focal_px"].get<double>(), 300 / (2 * std::tan(50 * std::numbers::pi / 180)), 1);
}

TEST_F(Ingest, AVideoOfPanoramasIsThatOfItsViews) {
  // The world moves across the panorama, as when the camera turns.
  const io::Image panorama = Panorama();
  const cv::Mat rgb(kPanorama / 2, kPanorama, CV_8UC3, const_cast<std::uint8_t*>(panorama.data.data()));
  const std::filesystem::path path = base_ / "around.avi";
  cv::VideoWriter writer(path.string(),
                         cv::CAP_FFMPEG,
                         cv::VideoWriter::fourcc('F', 'F', 'V', '1'),
                         25,
                         {kPanorama, kPanorama / 2});
  for (int i = 0; i < 24; ++i) {
    const int turn = 12 * i;
    cv::Mat frame(rgb.size(), rgb.type());
    rgb.colRange(turn, kPanorama).copyTo(frame.colRange(0, kPanorama - turn));
    if (turn > 0) rgb.colRange(0, turn).copyTo(frame.colRange(kPanorama - turn, kPanorama));
    writer.write(frame);
  }
  writer.release();
  ASSERT_EQ(Run(path, {"--max-frames", "30"}), 0) << message_;
  const std::size_t n_views = frames_["kept"].size(), n_frames = n_views / pipeline::PanoramaViews::kCount;
  EXPECT_EQ(n_views % pipeline::PanoramaViews::kCount, 0u);
  EXPECT_LE(n_frames, 10u) << "a third of what --max-frames says";
  EXPECT_GE(n_frames, 5u);
  EXPECT_NE(message_.find(std::to_string(n_frames) + " of 24 frames kept"), std::string::npos) << message_;
  EXPECT_EQ(frames_["kept"][n_frames]["heading_deg"], 60);
}

}  // namespace
