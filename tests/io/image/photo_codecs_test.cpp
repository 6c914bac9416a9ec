// The kinds of picture files, whole and damaged, through the decoders that photo.h chooses.
#include "io/image/photo_codecs.h"

#include <gtest/gtest.h>
#include <libheif/heif.h>

#include <cstdio>
#include <cstring>
// jpeglib.h needs FILE and size_t declared before it.
#include <jpeglib.h>

#include "io/image/media_type.h"
#include "tests/support/files/photo_files.h"
#include "tests/support/files/temp_dir.h"

namespace {

using tests::Encode;
using tests::ErrorAgainstPicture;
using tests::HasNote;
using tests::Picture;
using tests::ReasonFor;

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

TEST(PhotoCodecs, CmykIsConvertedNotReadAsRgb) {
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

// A palette of red and blue, of which the pixels are entries 1 and 0.
constexpr unsigned char kPalettePng[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44,
    0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x08, 0x03, 0x00, 0x00, 0x00, 0xc3,
    0xfc, 0x8f, 0xb8, 0x00, 0x00, 0x00, 0x06, 0x50, 0x4c, 0x54, 0x45, 0xc8, 0x0a, 0x14, 0x05,
    0x5a, 0xdc, 0x04, 0xed, 0x14, 0xb5, 0x00, 0x00, 0x00, 0x0b, 0x49, 0x44, 0x41, 0x54, 0x78,
    0xda, 0x63, 0x60, 0x64, 0x00, 0x00, 0x00, 0x05, 0x00, 0x02, 0x42, 0xc2, 0x44, 0x9f, 0x00,
    0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
};
// Adam7; the pixel (x, y) is (10 + 100 x, 20 + 100 y, 30).
constexpr unsigned char kInterlacedPng[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52,
    0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x02, 0x08, 0x02, 0x00, 0x00, 0x01, 0x8a, 0xd3, 0xaa,
    0xe5, 0x00, 0x00, 0x00, 0x15, 0x49, 0x44, 0x41, 0x54, 0x78, 0xda, 0x63, 0xe0, 0x12, 0x91, 0x63,
    0xc8, 0x03, 0x62, 0xae, 0x0a, 0xb9, 0xbc, 0x0a, 0x39, 0x00, 0x0e, 0x5b, 0x02, 0x81, 0x22, 0x27,
    0x77, 0xe2, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
};

template <std::size_t N>
io::Image Decoded(const unsigned char (&bytes)[N]) {
  return io::DecodePhoto({reinterpret_cast<const char*>(bytes), N}, 1600).image;
}

TEST(PhotoCodecs, PalettesAndInterlacedRowsAreResolved) {
  const io::Image palette = Decoded(kPalettePng), interlaced = Decoded(kInterlacedPng);
  EXPECT_EQ(palette.data, (std::vector<std::uint8_t>{5, 90, 220, 200, 10, 20}));
  EXPECT_EQ(interlaced.data, (std::vector<std::uint8_t>{10, 20, 30, 110, 20, 30, 10, 120, 30, 110, 120, 30}));
}

TEST(PhotoCodecs, OfSeveralPagesTheFirstIsUsedAndAnimationsAreRefused) {
  const TempDir dir;
  ASSERT_TRUE(cv::imwrite((dir / "pages.tiff").string(),
                          std::vector<cv::Mat>{Picture(CV_8UC3), cv::Mat::zeros(8, 8, CV_8UC3)}));
  const io::Photo first = io::DecodePhoto(ReadText(dir / "pages.tiff"), 1600);
  EXPECT_EQ(ErrorAgainstPicture(first.image), 0);
  EXPECT_TRUE(HasNote(first, "several pages"));
  // RFC 9649: an extended header whose flags say that frames follow.
  const std::string animated("RIFF\x20\0\0\0WEBPVP8X\x0a\0\0\0\x02\0\0\0\x07\0\0\x07\0\0\0\0\0\0\0\0", 36);
  EXPECT_NE(ReasonFor(animated).find("animated WebP"), std::string::npos);
}

TEST(PhotoCodecs, CutFilesAreRefused) {
  cv::Mat mat(200, 300, CV_8UC3);
  cv::randu(mat, 0, 256);
  for (const char* extension : {".jpg", ".png", ".webp", ".tiff"}) {
    const std::string file = Encode(extension, mat);
    EXPECT_EQ(ReasonFor(file), "") << extension;
    EXPECT_NE(ReasonFor(file.substr(0, file.size() / 2)), "") << extension;
    EXPECT_NE(ReasonFor(file.substr(0, 20)), "") << extension;
  }
}

TEST(PhotoCodecs, DamagedFilesAreRefused) {
  cv::Mat mat(200, 300, CV_8UC3);
  cv::randu(mat, 0, 256);
  std::string png = Encode(".png", mat);
  png[png.size() / 2] = static_cast<char>(png[png.size() / 2] ^ 0x55);
  EXPECT_NE(ReasonFor(png), "");
  std::string jpeg = Encode(".jpg", mat);
  for (std::size_t i = jpeg.size() / 2; i < jpeg.size() / 2 + 40; ++i)
    jpeg[i] = static_cast<char>(jpeg[i] ^ 0x55);
  EXPECT_NE(ReasonFor(jpeg).find("damaged JPEG"), std::string::npos);
  EXPECT_NE(ReasonFor("hello, I am a picture").find("the content is not a picture"), std::string::npos);
  EXPECT_NE(ReasonFor(""), "");
  EXPECT_NE(ReasonFor("GIF89a..............................").find("GIF"), std::string::npos);
}

// A WebP that is none, with what a DICOM file has at its place and behind it: OpenCV would ask that decoder.
TEST(PhotoCodecs, DicomIsNotDecoded) {
  std::string file("RIFF\x30\0\0\0WEBPVPV\0\0\0\0\0", 20);
  file.resize(128, '\xf6');
  file +=
      "DICM\xf6\xf6\xf6"
      "DOB\xd8\x0cV";
  file += '\0';
  EXPECT_NE(ReasonFor(file).find("DICOM"), std::string::npos);
}

// The size fields of a small PNG or JPEG overwritten.
TEST(PhotoCodecs, BombsAreRefusedByTheirHeader) {
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
TEST(PhotoCodecs, TiffsWhoseSizeIsNotWhatWasCheckedAreRefused) {
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
  wide[first + 2] = 16;
  EXPECT_NE(ReasonFor(wide).find("size in its header"), std::string::npos);
}

// TIFF 6.0: RowsPerStrip may exceed the height, and is 2^32 - 1 by default. OpenCV would allocate that much.
TEST(PhotoCodecs, StripsOfATiffMayBeHigherThanThePicture) {
  const std::string tiff = Encode(".tiff", Picture(CV_8UC3), {cv::IMWRITE_TIFF_COMPRESSION, 1});
  const std::size_t rows = tiff.find(std::string("\x16\x01", 2), tiff.size() - 300);
  ASSERT_NE(rows, std::string::npos);
  for (const std::uint32_t value : {33u, 40000u, 1u << 28, UINT32_MAX}) {
    std::string high = tiff;
    high.replace(rows, 12, std::string("\x16\x01\x04\0\x01\0\0\0\0\0\0\0", 12));
    std::memcpy(&high[rows + 8], &value, 4);
    ASSERT_EQ(ReasonFor(high), "") << value;
    EXPECT_EQ(ErrorAgainstPicture(io::DecodePhoto(high, 1600).image), 0) << value;
  }
}

TEST(PhotoCodecs, CameraRawInATiffIsRefusedByName) {
  std::string tiff = Encode(".tiff", Picture(CV_8UC3));
  ASSERT_EQ(tiff[0], 'I');
  std::uint32_t directory = 0;
  std::memcpy(&directory, &tiff[4], 4);
  const std::string dng = {'\x12', '\xc6', 1, 0, 4, 0, 0, 0, 1, 4, 0, 0};
  tiff.replace(directory + 2, 12, dng);
  EXPECT_NE(ReasonFor(tiff).find("camera raw"), std::string::npos);
}

TEST(PhotoCodecs, TiffsOfInkOrFractionsAreRefused) {
  std::string ink = Encode(".tiff", Picture(CV_8UC3));
  const std::string photometric = {6, 1, 3, 0, 1, 0, 0, 0};  // tag 262: 2 is RGB, 5 CMYK
  const std::size_t entry = ink.rfind(photometric);
  ASSERT_NE(entry, std::string::npos);
  ASSERT_EQ(ink[entry + 8], 2);
  ink[entry + 8] = 5;
  EXPECT_NE(ReasonFor(ink).find("CMYK TIFF"), std::string::npos) << ReasonFor(ink);
  cv::Mat fractions;
  Picture(CV_8UC3).convertTo(fractions, CV_32F, 1 / 255.0);
  EXPECT_NE(ReasonFor(Encode(".tiff", fractions)).find("neither 8 nor 16 bits"), std::string::npos);
}

std::string EncodeHeic(const io::Image& image, const std::string& icc) {
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
  if (!icc.empty()) heif_image_set_raw_color_profile(target, "prof", icc.data(), icc.size());
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

TEST(PhotoCodecs, HeicIsDecoded) {
  io::Image image = io::MakeImage(128, 96, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = i % 3 == 0 ? 200 : i % 3 == 1 ? static_cast<std::uint8_t>(i / 3 % 128) : 50;
  }
  const std::string file = EncodeHeic(image, "");
  if (file.empty()) GTEST_SKIP() << "libheif has no HEVC encoder here";
  EXPECT_EQ(io::MediaTypeOf(file), io::MediaType::kHeif);
  const io::Photo photo = io::DecodePhoto(file, 64);
  ASSERT_EQ(photo.image.width, 64);
  ASSERT_EQ(photo.image.height, 48);
  EXPECT_NEAR(photo.image.Pixel(30, 20)[0], 200, 8);
  EXPECT_NEAR(photo.image.Pixel(30, 20)[1], 60, 8);
  EXPECT_NEAR(photo.image.Pixel(30, 20)[2], 50, 8);
  EXPECT_NE(ReasonFor(file.substr(0, file.size() / 2)), "");
  EXPECT_TRUE(photo.notes.empty());
  const std::vector<std::string> notes = io::DecodePhoto(EncodeHeic(image, "no profile"), 64).notes;
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0], "colour profile 'unnamed' ignored: colours are read as sRGB");
}

}  // namespace
