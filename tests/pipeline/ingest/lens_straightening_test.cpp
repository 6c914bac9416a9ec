// Pictures of a fisheye lens become those of a pinhole camera.
#include "pipeline/ingest/lens_straightening.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/textured_room.h"

namespace {

constexpr int kPhotoWidth = 320, kPhotoHeight = 240, kPhotos = 8;
constexpr double kFocalPx = 160;  // of an equidistant lens: 115 degrees across

io::Image Taken(int i, bool is_fisheye) {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.25 - 0.06 * i, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return textured_room::Photo(
      kPhotoWidth, kPhotoHeight, {-1 + 0.25 * i, 0.1 * std::sin(i), -1 + 0.05 * i}, [&](double x, double y) {
        const Eigen::Vector2d at(x - kPhotoWidth / 2., y - kPhotoHeight / 2.);
        const double r = at.norm(), angle = is_fisheye ? r / kFocalPx : std::atan(r / kFocalPx);
        Eigen::Vector3d ray(0, 0, std::cos(angle));
        if (r > 0) ray.head<2>() = at / r * std::sin(angle);
        return Eigen::Vector3d(turn * ray);
      });
}

const io::Image& Photo(int i, bool is_fisheye) {
  static const std::vector<io::Image> photos = [] {
    std::vector<io::Image> taken(2 * kPhotos);
    for (int k = 0; k < 2 * kPhotos; ++k) taken[static_cast<std::size_t>(k)] = Taken(k / 2, k % 2 == 1);
    return taken;
  }();
  return photos[static_cast<std::size_t>(2 * i + is_fisheye)];
}

class LensStraightening : public testing::Test {
 protected:
  // Eight photos below folder/images, and a mask of the first.
  pipeline::IngestReport Straightened(bool is_fisheye, std::optional<double> focal_px = {}) {
    pipeline::IngestReport report;
    for (int i = 0; i < kPhotos; ++i) {
      pipeline::KeptPicture picture;
      picture.name = std::to_string(i) + ".png";
      picture.width = kPhotoWidth, picture.height = kPhotoHeight;
      picture.has_mask = i == 0;
      picture.focal_px = focal_px;
      std::filesystem::create_directories(folder_.path() / "images");
      io::WriteImage(folder_.path() / "images" / picture.name, Photo(i, is_fisheye));
      report.frames.kept.push_back(picture);
    }
    io::Mask mask{
        kPhotoWidth, kPhotoHeight, std::vector<std::uint8_t>(std::size_t{kPhotoWidth} * kPhotoHeight, 255)};
    std::fill_n(mask.used.begin(), mask.used.size() / 2, std::uint8_t{0});
    std::filesystem::create_directories(folder_.path() / "masks");
    io::WriteMask(folder_.path() / "masks" / "0.png", mask);
    pipeline::StraightenLenses(folder_.path(), {.threads = 2}, &report);
    return report;
  }

  io::Image Written(int i) { return io::ReadImage(folder_.path() / "images" / (std::to_string(i) + ".png")); }

  TempDir folder_;
};

TEST_F(LensStraightening, AFisheyesPicturesBecomeThoseOfAPinholeCamera) {
  const pipeline::IngestReport report = Straightened(true);
  ASSERT_EQ(report.decisions.size(), 1u);
  EXPECT_EQ(report.decisions[0].rfind("fisheye lens or action camera: 8 pictures made straight", 0), 0u);
  const pipeline::KeptPicture& kept = report.frames.kept[3];
  const io::Image image = Written(3);
  EXPECT_EQ(image.width, kept.width);
  EXPECT_EQ(image.height, kept.height);
  ASSERT_TRUE(kept.focal_px);
  EXPECT_NEAR(*kept.focal_px, kFocalPx, 0.15 * kFocalPx);
  // The scale of the lens in the middle, so a pinhole camera of its focal length shows the same.
  const io::Image truth = Photo(3, false);
  double difference = 0, unrelated = 0;
  for (int y = 20; y < kPhotoHeight - 20; ++y) {
    for (int x = 20; x < kPhotoWidth - 20; ++x) {
      const int at_x = x + (image.width - kPhotoWidth) / 2, at_y = y + (image.height - kPhotoHeight) / 2;
      difference += std::abs(image.Pixel(at_x, at_y)[0] - truth.Pixel(x, y)[0]);
      unrelated += std::abs(image.Pixel(at_x - 12, at_y)[0] - truth.Pixel(x, y)[0]);
    }
  }
  EXPECT_LT(difference, 0.5 * unrelated);
}

TEST_F(LensStraightening, MasksFollowTheirPictures) {
  const pipeline::KeptPicture kept = Straightened(true).frames.kept[0];
  const io::Mask mask = io::ReadMask(folder_.path() / "masks" / "0.png", kept.width, kept.height);
  EXPECT_NEAR(static_cast<double>(mask.UsedCount()), 0.5 * kept.width * kept.height, kept.width);
}

TEST_F(LensStraightening, OtherPicturesStayAsTheyAre) {
  EXPECT_TRUE(Straightened(false).decisions.empty());
  EXPECT_EQ(Written(3).data, Photo(3, false).data);
}

TEST_F(LensStraightening, AKnownFocalLengthOfNoWideLensIsBelieved) {
  EXPECT_TRUE(Straightened(true, 0.8 * kPhotoWidth).decisions.empty());
  EXPECT_EQ(Written(3).data, Photo(3, true).data);
}

TEST(StraightView, ShowsAsMuchAsTheLensAndAtMost120Degrees) {
  const double half_diagonal = std::hypot(kPhotoWidth, kPhotoHeight) / 2;
  // The border's middle is where the picture ends, as long as that is within 60 degrees.
  const pipeline::StraightView view(-0.5, kPhotoWidth, kPhotoHeight, 10000);
  const double r = kPhotoWidth / 2. / half_diagonal;
  EXPECT_NEAR(view.width(), kPhotoWidth / (1 - 0.5 * r * r), 1);
  // 180 degrees across half of the diagonal.
  const pipeline::StraightView wide(-2.5, kPhotoWidth, kPhotoHeight, 10000);
  EXPECT_NEAR(wide.degrees(), 120, 0.5);
  EXPECT_EQ(wide.width(), wide.height());
}

TEST(StraightView, IsNoLargerThanAsked) {
  const pipeline::StraightView whole(-0.5, kPhotoWidth, kPhotoHeight, 10000),
      small(-0.5, kPhotoWidth, kPhotoHeight, 200);
  EXPECT_EQ(small.width(), 200);
  EXPECT_NEAR(small.degrees(), whole.degrees(), 0.5);
  EXPECT_NEAR(small.focal_px() / whole.focal_px(), 200. / whole.width(), 0.01);
  // What shrinks is averaged: of stripes of a pixel remains grey.
  io::Image stripes = io::MakeImage(kPhotoWidth, kPhotoHeight, 3);
  for (int y = 0; y < kPhotoHeight; ++y) {
    for (int x = 0; x < kPhotoWidth; ++x)
      std::fill_n(stripes.Pixel(x, y), 3, static_cast<std::uint8_t>(x % 2 * 200));
  }
  const pipeline::StraightView shrinking(-0.5, kPhotoWidth, kPhotoHeight, whole.width() * 5 / 8);
  const io::Image shrunk = shrinking.Of(stripes);
  double most = 0;
  for (int x = -40; x < 40; ++x) {
    const int grey = shrunk.Pixel(shrunk.width / 2 + x, shrunk.height / 2)[0];
    most = std::max(most, std::abs(grey - 100.0));
  }
  EXPECT_LT(most, 60);
}

}  // namespace
