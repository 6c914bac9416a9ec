// io/image/image.h: lossless round trips, exact area averages, compositing.
#include "io/image/image.h"

#include <cmath>
#include <cstdlib>

#include "io/base/error.h"
#include "io/process/process.h"
#include "tests/support/files/temp_dir.h"

namespace {

using io::Image;

Image Pattern(int width, int height, int channels) {
  Image image = io::MakeImage(width, height, channels);
  for (std::size_t i = 0; i < image.data.size(); ++i)
    image.data[i] = static_cast<std::uint8_t>(i * 37 + i / 7);
  return image;
}

TEST(Image, PngRoundTripIsExact) {
  const TempDir dir;
  for (const int channels : {3, 4}) {
    const Image image = Pattern(31, 17, channels);
    io::WriteImage(dir / "i.png", image);
    const Image read = io::ReadImage(dir / "i.png");
    EXPECT_EQ(read.width, 31);
    EXPECT_EQ(read.height, 17);
    EXPECT_EQ(read.channels, channels);
    EXPECT_EQ(read.data, image.data);
  }
  EXPECT_EQ(CountEntries(dir.path()), 1);
}

TEST(Image, DamagedFilesAreRefusedByName) {
  const TempDir dir;
  for (const char* name : {"i.jpg", "i.png"}) {
    io::WriteImage(dir / name, Pattern(64, 48, 3));
    const std::string whole = ReadText(dir / name);
    std::string damaged = whole;
    for (std::size_t i = whole.size() / 2; i < whole.size() / 2 + 40; ++i) damaged[i] = '\x55';
    for (const std::string& bytes : {whole.substr(0, whole.size() / 2), whole.substr(0, 20), damaged}) {
      WriteText(dir / name, bytes);
      EXPECT_ERROR(io::ReadImage(dir / name), io::ExitCode::kBadInput, name);
    }
  }
}

TEST(Image, ChannelsAreRedGreenBlueInFiles) {
  const TempDir dir;
  WriteText(dir / "red.ppm", std::string("P6 1 1 255\n\xff\x02\x01", 14));
  const Image image = io::ReadImage(dir / "red.ppm");
  EXPECT_EQ(image.data, (std::vector<std::uint8_t>{255, 2, 1}));
}

TEST(Image, GreyBecomesRgbAndSixteenBitsAreRounded) {
  const TempDir dir;
  WriteText(dir / "grey.pgm", std::string("P5 2 1 255\n\x07\xc8", 13));
  EXPECT_EQ(io::ReadImage(dir / "grey.pgm").data, (std::vector<std::uint8_t>{7, 7, 7, 200, 200, 200}));
  // 128 = 0.498 * 257 rounds down, 129 = 0.502 * 257 up; 65535 is white.
  WriteText(dir / "deep.pgm", std::string("P5 3 1 65535\n\x00\x80\x00\x81\xff\xff", 19));
  EXPECT_EQ(io::ReadImage(dir / "deep.pgm").data,
            (std::vector<std::uint8_t>{0, 0, 0, 1, 1, 1, 255, 255, 255}));
}

TEST(Image, JpegIsClose) {
  const TempDir dir;
  Image image = io::MakeImage(64, 64, 3);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      std::uint8_t* pixel = image.Pixel(x, y);
      pixel[0] = static_cast<std::uint8_t>(4 * x);
      pixel[1] = static_cast<std::uint8_t>(4 * y);
      pixel[2] = static_cast<std::uint8_t>(2 * (x + y));
    }
  }
  io::WriteImage(dir / "i.jpg", image);
  const Image read = io::ReadImage(dir / "i.jpg");
  ASSERT_EQ(read.data.size(), image.data.size());
  for (std::size_t i = 0; i < image.data.size(); ++i) EXPECT_NEAR(read.data[i], image.data[i], 12);
  const std::vector<std::uint8_t> bytes = io::EncodeImage(image, ".jpg");
  EXPECT_EQ(ReadText(dir / "i.jpg"), std::string(bytes.begin(), bytes.end()));
}

TEST(Image, UnreadableFilesAreNamed) {
  const TempDir dir;
  WriteText(dir / "text.png", "this is no picture");
  EXPECT_ERROR(io::ReadImage(dir / "text.png"), io::ExitCode::kBadInput, "text.png");
  EXPECT_ERROR(io::ReadImage(dir / "none.png"), io::ExitCode::kBadInput, "none.png");
  io::WriteImage(dir / "i.png", Pattern(64, 64, 3));
  const std::string png = ReadText(dir / "i.png");
  WriteText(dir / "cut.png", png.substr(0, png.size() / 2));
  EXPECT_ERROR(io::ReadImage(dir / "cut.png"), io::ExitCode::kBadInput, "cut.png");
}

TEST(Image, AreaResizeIsTheMeanOfTheCoveredArea) {
  const Image image = Pattern(12, 6, 3);
  const Image small = io::ResizeArea(image, 4, 3);  // blocks of 3 x 2
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) {
      for (int c = 0; c < 3; ++c) {
        double sum = 0;
        for (int j = 0; j < 2; ++j) {
          for (int i = 0; i < 3; ++i) sum += image.Pixel(3 * x + i, 2 * y + j)[c];
        }
        EXPECT_NEAR(small.Pixel(x, y)[c], sum / 6, 0.501);
      }
    }
  }
  // 3 -> 2 pixels: each takes one and a half.
  Image row = io::MakeImage(3, 1, 3);
  for (int c = 0; c < 3; ++c) row.Pixel(0, 0)[c] = 30, row.Pixel(1, 0)[c] = 60, row.Pixel(2, 0)[c] = 90;
  const Image two = io::ResizeArea(row, 2, 1);
  EXPECT_EQ(two.Pixel(0, 0)[0], 40);
  EXPECT_EQ(two.Pixel(1, 0)[0], 80);
  EXPECT_EQ(io::ResizeArea(image, 12, 6).data, image.data);
}

TEST(Image, ResizingAndCompositingCommute) {
  Image image = Pattern(16, 16, 4);
  for (std::size_t i = 3; i < image.data.size(); i += 4) image.data[i] = i % 5 == 0 ? 0 : i % 3 ? 255 : 200;
  const Image a = io::CompositeOn(io::ResizeArea(image, 4, 4), 255);
  const Image b = io::ResizeArea(io::CompositeOn(image, 255), 4, 4);
  ASSERT_EQ(a.channels, 3);
  for (std::size_t i = 0; i < a.data.size(); ++i) EXPECT_NEAR(a.data[i], b.data[i], 2);
}

TEST(Image, CompositeBlendsWithTheBackground) {
  const Image image{1, 1, 4, {100, 0, 255, 51}};  // a fifth
  EXPECT_EQ(io::CompositeOn(image, 255).data, (std::vector<std::uint8_t>{224, 204, 255}));
  EXPECT_EQ(io::CompositeOn(image, 0).data, (std::vector<std::uint8_t>{20, 0, 51}));
  const Image rgb = Pattern(2, 2, 3);
  EXPECT_EQ(io::CompositeOn(rgb, 9).data, rgb.data);
}

TEST(Image, WithoutAlphaColoursStay) {
  const Image image = Pattern(5, 3, 4), rgb = io::WithoutAlpha(image);
  ASSERT_EQ(rgb.channels, 3);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) {
      for (int c = 0; c < 3; ++c) EXPECT_EQ(rgb.Pixel(x, y)[c], image.Pixel(x, y)[c]);
    }
  }
}

}  // namespace
