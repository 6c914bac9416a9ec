// io/image/photo.h and what stands behind it: every kind of picture file, whole and damaged.
#include "io/image/photo.h"

#include <gtest/gtest.h>
#include <libheif/heif.h>

#include <cmath>
#include <cstdio>
#include <cstring>
// jpeglib.h needs FILE and size_t declared before it.
#include <jpeglib.h>

#include <array>
#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>

#include "io/base/error.h"
#include "io/base/natural_order.h"
#include "io/image/media_type.h"
#include "io/image/photo_tags.h"
#include "io/image/picture_measure.h"

namespace {

constexpr int kWidth = 48, kHeight = 32;

// A smooth gradient with a distinct colour in each corner, so that every flip and turn shows.
cv::Mat Picture(int type) {
  cv::Mat mat(kHeight, kWidth, CV_8UC3);
  mat.forEach<cv::Vec3b>([](cv::Vec3b& p, const int* at) {
    p = cv::Vec3b(static_cast<uchar>(40 + 2 * at[0]), static_cast<uchar>(30 + 4 * at[1]), 90);
  });
  cv::Mat result(kHeight, kWidth, CV_MAKETYPE(CV_8U, CV_MAT_CN(type)), cv::Scalar::all(200));
  for (int c = 0; c < std::min(3, result.channels()); ++c)
    cv::mixChannels(mat, result, std::array{c, c}.data(), 1);
  if (CV_MAT_DEPTH(type) == CV_16U) result.convertTo(result, CV_16U, 257.0);
  return result;
}

std::string Encode(const char* extension, const cv::Mat& mat, const std::vector<int>& options = {}) {
  std::vector<uchar> bytes;
  EXPECT_TRUE(cv::imencode(extension, mat, bytes, options));
  return {bytes.begin(), bytes.end()};
}

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
  const Exiv2::DataBuf bytes = io.read(io.size());
  return {reinterpret_cast<const char*>(bytes.pData_), static_cast<std::size_t>(bytes.size_)};
}

std::string ReasonFor(const std::string& file) {
  try {
    io::DecodePhoto(file, 1600);
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kBadInput);
    return error.what();
  }
  return "";
}

bool HasNote(const io::Photo& photo, const std::string& part) {
  for (const std::string& note : photo.notes) {
    if (note.find(part) != std::string::npos) return true;
  }
  return false;
}

// Largest channel difference to Picture(), which is BGR.
int ErrorAgainstPicture(const io::Image& image) {
  const cv::Mat mat = Picture(CV_8UC3);
  int worst = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) {
        worst = std::max(worst, std::abs(image.Pixel(x, y)[c] - mat.at<cv::Vec3b>(y, x)[2 - c]));
      }
    }
  }
  return worst;
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
      ASSERT_EQ(image.width, c.transposed ? kHeight : kWidth);
      ASSERT_EQ(image.height, c.transposed ? kWidth : kHeight);
      const io::Photo small = io::DecodePhoto(file, kWidth / 2);
      EXPECT_EQ(small.orientation, c.orientation);
      EXPECT_EQ(small.full_width, image.width);
      EXPECT_EQ(small.full_height, image.height);
      const int x = c.right ? image.width - 1 : 0, y = c.bottom ? image.height - 1 : 0;
      EXPECT_EQ(std::memcmp(image.Pixel(x, y), stored.Pixel(0, 0), 3), 0) << c.orientation;
      // The stored top right corner tells mirrored from turned.
      const int right_x = c.transposed ? x : image.width - 1 - x,
                right_y = c.transposed ? image.height - 1 - y : y;
      EXPECT_EQ(std::memcmp(image.Pixel(right_x, right_y), stored.Pixel(kWidth - 1, 0), 3), 0)
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
  EXPECT_NEAR(decode("27", 1600).focal_px.value(), 27.0 * kWidth / 36, 1e-9);
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
  EXPECT_NEAR(plane.focal_px.value(), 5.4 * 10 * kWidth / 96, 1e-6);
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
  EXPECT_EQ(io::DecodePhoto(Encode(".png", Picture(CV_8UC3)), 4000).image.width, kWidth);
}

// Ink values as an Adobe program stores them (inverted) or as plain CMYK.
std::string CmykJpeg(bool adobe, const std::array<unsigned char, 4>& stored) {
  jpeg_compress_struct jpeg = {};
  jpeg_error_mgr errors = {};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &bytes, &size);
  jpeg.image_width = jpeg.image_height = 8;
  jpeg.input_components = 4;
  jpeg.in_color_space = JCS_CMYK;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 100, TRUE);
  jpeg.write_Adobe_marker = adobe;
  jpeg_start_compress(&jpeg, TRUE);
  std::vector<unsigned char> row;
  for (int i = 0; i < 8; ++i) row.insert(row.end(), stored.begin(), stored.end());
  unsigned char* rows[] = {row.data()};
  for (int y = 0; y < 8; ++y) jpeg_write_scanlines(&jpeg, rows, 1);
  jpeg_finish_compress(&jpeg);
  std::string file(reinterpret_cast<char*>(bytes), size);
  jpeg_destroy_compress(&jpeg);
  std::free(bytes);
  return file;
}

TEST(Photo, CmykIsConvertedNotReadAsRgb) {
  for (const bool adobe : {false, true}) {
    // Full yellow, half key.
    const std::array<unsigned char, 4> ink = {0, 0, 255, 128};
    std::array<unsigned char, 4> stored = ink;
    if (adobe) {
      for (unsigned char& v : stored) v = static_cast<unsigned char>(255 - v);
    }
    const io::Photo photo = io::DecodePhoto(CmykJpeg(adobe, stored), 1600);
    ASSERT_EQ(photo.image.channels, 3);
    EXPECT_NEAR(photo.image.Pixel(3, 3)[0], 127, 3);
    EXPECT_NEAR(photo.image.Pixel(3, 3)[1], 127, 3);
    EXPECT_NEAR(photo.image.Pixel(3, 3)[2], 0, 3);
    EXPECT_TRUE(HasNote(photo, "CMYK"));
  }
}

TEST(Photo, CutFilesAreRefused) {
  cv::Mat mat(200, 300, CV_8UC3);
  cv::randu(mat, 0, 256);
  for (const char* extension : {".jpg", ".png", ".webp", ".tiff"}) {
    const std::string file = Encode(extension, mat);
    EXPECT_EQ(ReasonFor(file), "") << extension;
    EXPECT_NE(ReasonFor(file.substr(0, file.size() / 2)), "") << extension;
    EXPECT_NE(ReasonFor(file.substr(0, 20)), "") << extension;
  }
}

TEST(Photo, DamagedFilesAreRefused) {
  cv::Mat mat(200, 300, CV_8UC3);
  cv::randu(mat, 0, 256);
  std::string png = Encode(".png", mat);
  png[png.size() / 2] = static_cast<char>(png[png.size() / 2] ^ 0x55);
  EXPECT_NE(ReasonFor(png), "");
  std::string jpeg = Encode(".jpg", mat);
  for (std::size_t i = jpeg.size() / 2; i < jpeg.size() / 2 + 40; ++i)
    jpeg[i] = static_cast<char>(jpeg[i] ^ 0x55);
  EXPECT_NE(ReasonFor(jpeg).find("damaged JPEG"), std::string::npos);
  EXPECT_NE(ReasonFor("hello, I am a picture"), "");
  EXPECT_NE(ReasonFor(""), "");
  EXPECT_NE(ReasonFor("GIF89a..............................").find("GIF"), std::string::npos);
}

// The size fields of a small PNG or JPEG overwritten.
TEST(Photo, BombsAreRefusedByTheirHeader) {
  std::string png = Encode(".png", Picture(CV_8UC3));
  const std::string side = std::string("\x00\x00\xea\x60", 4);  // 60,000
  png.replace(16, 4, side).replace(20, 4, side);
  EXPECT_NE(ReasonFor(png).find("60000 x 60000"), std::string::npos);
  std::string jpeg = Encode(".jpg", Picture(CV_8UC3));
  const std::size_t frame = jpeg.find("\xff\xc0");
  ASSERT_NE(frame, std::string::npos);
  jpeg.replace(frame + 5, 4, "\x75\x30\x75\x30");  // 30,000 x 30,000
  EXPECT_NE(ReasonFor(jpeg).find("30000 x 30000"), std::string::npos);
}

// Decoders take the first of two widths, and widths of 64 bits.
TEST(Photo, TiffsWhoseSizeIsNotWhatWasCheckedAreRefused) {
  const std::string tiff = Encode(".tiff", Picture(CV_8UC3));
  ASSERT_EQ(tiff[0], 'I');
  std::uint32_t directory = 0;
  std::uint16_t n_entries = 0;
  std::memcpy(&directory, &tiff[4], 4);
  std::memcpy(&n_entries, &tiff[directory], 2);
  const std::string width = {0, 1, 3, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  const std::size_t first = directory + 2, last = first + 12 * (n_entries - 1u);
  ASSERT_EQ(tiff.substr(first, 2), width.substr(0, 2));
  std::string twice = tiff, wide = tiff;
  twice.replace(last, 12, width);
  EXPECT_NE(ReasonFor(twice).find("size in its header"), std::string::npos);
  const std::size_t rows = tiff.find(std::string("\x16\x01", 2), first);
  ASSERT_LT(rows, last);
  std::string strip = tiff;
  strip.replace(rows, 12, std::string("\x16\x01\x04\0\x01\0\0\0\0\0\0\x10", 12));  // of 2^28 rows
  EXPECT_NE(ReasonFor(strip).find("268435456"), std::string::npos) << ReasonFor(strip);
  wide[first + 2] = 16;
  EXPECT_NE(ReasonFor(wide).find("size in its header"), std::string::npos);
}

TEST(Photo, CameraRawInATiffIsRefusedByName) {
  std::string tiff = Encode(".tiff", Picture(CV_8UC3));
  ASSERT_EQ(tiff[0], 'I');
  std::uint32_t directory = 0;
  std::memcpy(&directory, &tiff[4], 4);
  const std::string dng = {'\x12', '\xc6', 1, 0, 4, 0, 0, 0, 1, 4, 0, 0};
  tiff.replace(directory + 2, 12, dng);
  EXPECT_NE(ReasonFor(tiff).find("camera raw"), std::string::npos);
}

std::string EncodeHeic(const io::Image& image) {
  std::unique_ptr<heif_context, decltype(&heif_context_free)> heif(heif_context_alloc(), heif_context_free);
  heif_encoder* encoder = nullptr;
  if (heif_context_get_encoder_for_format(heif.get(), heif_compression_HEVC, &encoder).code != heif_error_Ok)
    return "";
  heif_encoder_set_lossy_quality(encoder, 95);
  heif_image* target = nullptr;
  heif_image_create(image.width, image.height, heif_colorspace_RGB, heif_chroma_interleaved_RGB, &target);
  heif_image_add_plane(target, heif_channel_interleaved, image.width, image.height, 8);
  int stride = 0;
  std::uint8_t* plane = heif_image_get_plane(target, heif_channel_interleaved, &stride);
  for (int y = 0; y < image.height; ++y) {
    std::memcpy(plane + y * stride, image.Pixel(0, y), static_cast<std::size_t>(image.width) * 3);
  }
  heif_image_handle* handle = nullptr;
  EXPECT_EQ(heif_context_encode_image(heif.get(), target, encoder, nullptr, &handle).code, heif_error_Ok);
  heif_writer writer = {1, [](heif_context*, const void* data, size_t size, void* file) {
                          static_cast<std::string*>(file)->assign(static_cast<const char*>(data), size);
                          return heif_error{heif_error_Ok, heif_suberror_Unspecified, ""};
                        }};
  std::string file;
  heif_context_write(heif.get(), &writer, &file);
  heif_image_handle_release(handle);
  heif_image_release(target);
  heif_encoder_release(encoder);
  return file;
}

TEST(Photo, HeicIsDecoded) {
  io::Image image = io::MakeImage(128, 96, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = i % 3 == 0 ? 200 : i % 3 == 1 ? static_cast<std::uint8_t>(i / 3 % 128) : 50;
  }
  const std::string file = EncodeHeic(image);
  if (file.empty()) GTEST_SKIP() << "libheif has no HEVC encoder here";
  EXPECT_EQ(io::MediaTypeOf(file), io::MediaType::kHeif);
  const io::Photo photo = io::DecodePhoto(file, 64);
  ASSERT_EQ(photo.image.width, 64);
  ASSERT_EQ(photo.image.height, 48);
  EXPECT_NEAR(photo.image.Pixel(30, 20)[0], 200, 8);
  EXPECT_NEAR(photo.image.Pixel(30, 20)[1], 60, 8);
  EXPECT_NEAR(photo.image.Pixel(30, 20)[2], 50, 8);
  EXPECT_NE(ReasonFor(file.substr(0, file.size() / 2)), "");
}

TEST(PhotoTags, ForeignProfilesAreNamed) {
  std::string icc(128, '\0');
  icc += std::string("\0\0\0\1desc\0\0\0\x90\0\0\0\x20", 16);
  std::string text = std::string("desc\0\0\0\0\0\0\0\x0b", 12) + "Display P3";
  text.resize(0x20);
  EXPECT_EQ(io::ForeignProfileName(icc + text), "Display P3");
  text.replace(12, 10, "sRGB IEC61");
  EXPECT_EQ(io::ForeignProfileName(icc + text), "");
  EXPECT_EQ(io::ForeignProfileName(icc), "unnamed");
}

TEST(PictureMeasure, BlurLowersSharpnessAndContrastDoesNot) {
  io::Image sharp = io::MakeImage(320, 240, 3);
  std::uint32_t state = 1;
  for (int y = 0; y < sharp.height; ++y) {
    for (int x = 0; x < sharp.width; ++x) {
      if (x % 8 == 0) state = state * 1664525u + 1013904223u;
      const auto value = static_cast<std::uint8_t>((state >> 24) / 2 * ((y / 6 + x / 8) % 2) + 40);
      std::memset(sharp.Pixel(x, y), value, 3);
    }
  }
  io::Image blurred = sharp, faint = sharp;
  for (int y = 0; y < sharp.height; ++y) {
    for (int x = 6; x < sharp.width - 6; ++x) {
      int sum = 0;
      for (int k = -6; k <= 6; ++k) sum += sharp.Pixel(x + k, y)[0];
      std::memset(blurred.Pixel(x, y), sum / 13, 3);  // motion along x only
    }
  }
  for (std::uint8_t& value : faint.data) value = static_cast<std::uint8_t>(100 + value / 2);
  EXPECT_LT(io::Sharpness(blurred), 0.4 * io::Sharpness(sharp));
  EXPECT_NEAR(io::Sharpness(faint), io::Sharpness(sharp), 0.1 * io::Sharpness(sharp));
}

TEST(NaturalOrder, NumbersCompareByValue) {
  EXPECT_TRUE(io::NaturalLess("img2.jpg", "img10.jpg"));
  EXPECT_FALSE(io::NaturalLess("img10.jpg", "img2.jpg"));
  EXPECT_TRUE(io::NaturalLess("a1b2", "a01b3"));
  EXPECT_TRUE(io::NaturalLess("a", "ab"));
  EXPECT_FALSE(io::NaturalLess("x", "x"));
  EXPECT_NE(io::NaturalLess("1", "01"), io::NaturalLess("01", "1"));
}

}  // namespace
