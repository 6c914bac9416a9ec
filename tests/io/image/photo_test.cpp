// Pictures of users: upright, 8-bit, no larger than asked for, with what their tags say.
#include "io/image/photo.h"

#include <gtest/gtest.h>

#include <cstring>
#include <exiv2/exiv2.hpp>

#include "tests/support/files/photo_files.h"

namespace {

using tests::Encode;
using tests::ErrorAgainstPicture;
using tests::HasNote;
using tests::kPhotoHeight;
using tests::kPhotoWidth;
using tests::Picture;

std::string WithExif(const std::string& file, const std::vector<std::pair<const char*, std::string>>& tags) {
  const auto image = Exiv2::ImageFactory::open(reinterpret_cast<const Exiv2::byte*>(file.data()),
                                               static_cast<long>(file.size()));
  image->readMetadata();
  Exiv2::ExifData exif;
  for (const auto& [key, value] : tags) {
    auto typed = Exiv2::Value::create(Exiv2::ExifKey(key).defaultTypeId());
    typed->read(value);
    exif.add(Exiv2::ExifKey(key), typed.get());
  }
  image->setExifData(exif);
  image->writeMetadata();
  Exiv2::BasicIo& io = image->io();
  io.open();
  const Exiv2::DataBuf bytes = io.read(static_cast<long>(io.size()));
  return {reinterpret_cast<const char*>(bytes.pData_), static_cast<std::size_t>(bytes.size_)};
}

TEST(Photo, LosslessKindsKeepEveryPixel) {
  for (const char* extension : {".png", ".tiff"}) {
    const io::Photo photo = io::DecodePhoto(Encode(extension, Picture(CV_8UC3)), 1600);
    EXPECT_EQ(photo.image.channels, 3);
    EXPECT_EQ(ErrorAgainstPicture(photo.image), 0) << extension;
    EXPECT_TRUE(photo.notes.empty());
    EXPECT_FALSE(photo.focal_px.has_value());
  }
}

TEST(Photo, LossyKindsComeClose) {
  const std::string jpeg = Encode(".jpg", Picture(CV_8UC3), {cv::IMWRITE_JPEG_QUALITY, 98});
  const std::string progressive = Encode(".jpg", Picture(CV_8UC3), {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  const std::string webp = Encode(".webp", Picture(CV_8UC3), {cv::IMWRITE_WEBP_QUALITY, 100});
  for (const std::string& file : {jpeg, progressive, webp}) {
    EXPECT_LE(ErrorAgainstPicture(io::DecodePhoto(file, 1600).image), 6);
  }
}

TEST(Photo, SixteenBitsAreScaledAndRounded) {
  cv::Mat mat(1, 3, CV_16UC3, cv::Scalar::all(0));
  mat.at<cv::Vec3w>(0, 1) = cv::Vec3w::all(128 * 257 + 128);  // 128.498 rounds down
  mat.at<cv::Vec3w>(0, 2) = cv::Vec3w::all(128 * 257 + 129);  // 128.502 rounds up
  for (const char* extension : {".png", ".tiff"}) {
    const io::Photo photo = io::DecodePhoto(Encode(extension, mat), 1600);
    EXPECT_EQ(photo.image.Pixel(1, 0)[0], 128);
    EXPECT_EQ(photo.image.Pixel(2, 0)[0], 129);
    EXPECT_TRUE(HasNote(photo, "16 bits"));
  }
}

TEST(Photo, GreyBecomesRgb) {
  for (const char* extension : {".png", ".jpg"}) {
    const io::Photo photo = io::DecodePhoto(Encode(extension, Picture(CV_8UC1)), 1600);
    ASSERT_EQ(photo.image.channels, 3);
    EXPECT_EQ(photo.image.Pixel(5, 9)[0], photo.image.Pixel(5, 9)[2]);
    EXPECT_NEAR(photo.image.Pixel(5, 9)[1], 40 + 2 * 9, 3);
    EXPECT_TRUE(HasNote(photo, "grey"));
  }
}

TEST(Photo, AlphaStaysOnlyWhereItMeansSomething) {
  cv::Mat mat = Picture(CV_8UC4);
  EXPECT_EQ(io::DecodePhoto(Encode(".png", mat), 1600).image.channels, 4);
  EXPECT_EQ(io::DecodePhoto(Encode(".png", mat), 1600).image.Pixel(0, 0)[3], 200);
  mat.forEach<cv::Vec4b>([](cv::Vec4b& p, const int*) { p[3] = 255; });
  const io::Photo opaque = io::DecodePhoto(Encode(".png", mat), 1600);
  EXPECT_EQ(opaque.image.channels, 3);
  EXPECT_EQ(ErrorAgainstPicture(opaque.image), 0);
}

TEST(Photo, OrientationIsBakedOnce) {
  // Where EXIF says that the stored top left corner belongs, from EXIF 2.32: {right?, bottom?} and
  // transposed?
  struct Case {
    int orientation;
    bool right, bottom, transposed;
  };
  constexpr Case kCases[] = {Case{1, false, false, false},
                             Case{2, true, false, false},
                             Case{3, true, true, false},
                             Case{4, false, true, false},
                             Case{5, false, false, true},
                             Case{6, true, false, true},
                             Case{7, true, true, true},
                             Case{8, false, true, true}};
  for (const char* extension : {".png", ".tiff"}) {
    const std::string whole = Encode(extension, Picture(CV_8UC3));
    const io::Image stored = io::DecodePhoto(whole, 1600).image;
    for (const Case& c : kCases) {
      const std::string file = WithExif(whole, {{"Exif.Image.Orientation", std::to_string(c.orientation)}});
      const io::Image image = io::DecodePhoto(file, 1600).image;
      ASSERT_EQ(image.width, c.transposed ? kPhotoHeight : kPhotoWidth);
      ASSERT_EQ(image.height, c.transposed ? kPhotoWidth : kPhotoHeight);
      const io::Photo small = io::DecodePhoto(file, kPhotoWidth / 2);
      EXPECT_EQ(small.orientation, c.orientation);
      EXPECT_EQ(small.full_width, image.width);
      EXPECT_EQ(small.full_height, image.height);
      const int x = c.right ? image.width - 1 : 0, y = c.bottom ? image.height - 1 : 0;
      EXPECT_EQ(std::memcmp(image.Pixel(x, y), stored.Pixel(0, 0), 3), 0) << c.orientation;
      // The stored top right corner tells mirrored from turned.
      const int right_x = c.transposed ? x : image.width - 1 - x,
                right_y = c.transposed ? image.height - 1 - y : y;
      EXPECT_EQ(std::memcmp(image.Pixel(right_x, right_y), stored.Pixel(kPhotoWidth - 1, 0), 3), 0)
          << c.orientation;
    }
  }
}

TEST(Photo, ADamagedColourProfileCostsNoOrientation) {
  const std::string exif = WithExif(Encode(".jpg", Picture(CV_8UC3)), {{"Exif.Image.Orientation", "6"}});
  // APP2 marker behind the EXIF block (ICC.1:2010, annex B.4), with a profile of one byte.
  const std::string profile = std::string("ICC_PROFILE\0\1\1", 14) + "x";
  const std::string marker = std::string("\xff\xe2\0", 3) + static_cast<char>(profile.size() + 2) + profile;
  const std::size_t exif_at = exif.find("Exif") - 4;
  const std::size_t exif_size =
      static_cast<unsigned char>(exif[exif_at + 2]) * 256u + static_cast<unsigned char>(exif[exif_at + 3]);
  std::string file = exif;
  file.insert(exif_at + 2 + exif_size, marker);
  EXPECT_EQ(io::DecodePhoto(file, 1600).orientation, 6);
}

TEST(Photo, FocalLengthFollowsTheSizeAndLiesAreIgnored) {
  const std::string jpeg = Encode(".jpg", Picture(CV_8UC3));
  const auto decode = [&](const char* focal, int side) {
    return io::DecodePhoto(
        WithExif(jpeg, {{"Exif.Photo.FocalLengthIn35mmFilm", focal}, {"Exif.Image.Model", "Box"}}), side);
  };
  // 48 x 32 has the aspect of 36 x 24 mm film.
  EXPECT_NEAR(decode("27", 1600).focal_px.value(), 27.0 * kPhotoWidth / 36, 1e-9);
  EXPECT_NEAR(decode("27", 24).focal_px.value(), 27.0 * 24 / 36, 1e-9);
  EXPECT_EQ(decode("27", 1600).model, "Box");
  EXPECT_FALSE(decode("60000", 1600).focal_px.has_value());
  EXPECT_TRUE(HasNote(decode("60000", 1600), "focal"));

  const io::Photo plane = io::DecodePhoto(WithExif(jpeg,
                                                   {{"Exif.Photo.FocalLength", "54/10"},
                                                    {"Exif.Photo.FocalPlaneXResolution", "100/1"},
                                                    {"Exif.Photo.FocalPlaneResolutionUnit", "3"},
                                                    {"Exif.Photo.PixelXDimension", "96"}}),
                                          1600);
  EXPECT_NEAR(plane.focal_px.value(), 5.4 * 10 * kPhotoWidth / 96, 1e-6);
  const io::Photo nonsense = io::DecodePhoto(WithExif(jpeg,
                                                      {{"Exif.Photo.FocalLength", "5/0"},
                                                       {"Exif.Photo.FocalPlaneXResolution", "1/0"},
                                                       {"Exif.Photo.PixelXDimension", "96"}}),
                                             1600);
  EXPECT_FALSE(nonsense.focal_px.has_value());
}

TEST(Photo, LongestSideIsLimitedAndNeverEnlarged) {
  const io::Photo small = io::DecodePhoto(Encode(".png", Picture(CV_8UC3)), 24);
  EXPECT_EQ(small.image.width, 24);
  EXPECT_EQ(small.image.height, 16);
  EXPECT_EQ(io::DecodePhoto(Encode(".png", Picture(CV_8UC3)), 4000).image.width, kPhotoWidth);
}

}  // namespace
