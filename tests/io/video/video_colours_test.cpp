// io/video/video_colours.h: what files say, and sRGB from it.
#include "io/video/video_colours.h"

#include <gtest/gtest.h>

#include <cmath>

#include "io/process/process.h"
#include "io/video/video_reader.h"
#include "io/video/video_tags.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/require_program.h"

namespace {

using Colour = io::ColourConversion::Colour;

// R'G'B' by the BT.601 matrix of the Y'CbCr that BT.709's or BT.2020's makes of a colour.
Colour Misread(const Colour& rgb, double red, double blue) {
  const double luma = red * rgb[0] + (1 - red - blue) * rgb[1] + blue * rgb[2];
  const double cb = (rgb[2] - luma) / (2 - 2 * blue), cr = (rgb[0] - luma) / (2 - 2 * red);
  return {luma + 1.402 * cr, luma - 0.344136286 * cb - 0.714136286 * cr, luma + 1.772 * cb};
}

double Srgb(double light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

void ExpectNear(const Colour& found, const Colour& expected, double tolerance) {
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(found[i], expected[i], tolerance) << i;
}

TEST(ColourConversion, TheMatrixIsTheOneThatTheFileNames) {
  const Colour rgb{0.2, 0.6, 0.4};
  const Colour misread = Misread(rgb, 0.2126, 0.0722);
  ExpectNear(io::ColourConversion({.matrix = "bt709"}, 480).Exact(misread), rgb, 1e-6);
  ExpectNear(
      io::ColourConversion({.matrix = "bt2020nc"}, 480).Exact(Misread(rgb, 0.2627, 0.0593)), rgb, 1e-6);
  // Nothing said: by size.
  ExpectNear(io::ColourConversion({}, 720).Exact(misread), rgb, 1e-6);
  ExpectNear(io::ColourConversion({.matrix = "unknown"}, 577).Exact(misread), rgb, 1e-6);
  for (const char* matrix : {"smpte170m", "bt470bg", "gbr"})
    EXPECT_FALSE(io::ColourConversion({.matrix = matrix}, 1080).Converts()) << matrix;
  EXPECT_FALSE(io::ColourConversion({}, 576).Converts());
}

TEST(ColourConversion, GreyOfHdrHasThePublishedLight) {
  // BT.2408, table 1: a white of 203 cd/m^2 has 75 % of an HLG signal and 58 % of a PQ signal; a grey card of
  // 18 %, 26 cd/m^2, has 38 % of both.
  for (const auto& [transfer, white] : {std::pair("arib-std-b67", 0.75), std::pair("smpte2084", 0.5807)}) {
    const io::ColourConversion conversion({.matrix = "bt2020nc", .transfer = transfer, .primaries = "bt2020"},
                                          1080);
    EXPECT_TRUE(conversion.IsHdr());
    const auto grey = [&](double v) { return conversion.Exact({v, v, v}); };
    ExpectNear(grey(0), {0, 0, 0}, 1e-9);
    const double card = Srgb(26.0 / 203);
    ExpectNear(grey(0.38), {card, card, card}, 0.01);
    ExpectNear(grey(white), {0.902, 0.902, 0.902}, 0.005);
    ExpectNear(grey(1), {1, 1, 1}, 1e-6);
    double last = 0;
    for (int i = 1; i <= 100; ++i) {
      const double value = grey(0.01 * i)[1];
      EXPECT_GE(value, last - 1e-12) << i;
      last = value;
    }
  }
}

TEST(ColourConversion, WidePrimariesBecomeThoseOfSrgb) {
  // sRGB's red in BT.2020 and in P3, as published (ITU-R BT.2087; SMPTE EG 432-1 by its chromaticities).
  const io::ColourConversion wide({.matrix = "smpte170m", .primaries = "bt2020"}, 480);
  ExpectNear(wide.Exact({Srgb(0.6274), Srgb(0.0691), Srgb(0.0164)}), {1, 0, 0}, 0.01);
  const io::ColourConversion p3({.matrix = "smpte170m", .primaries = "smpte432"}, 480);
  ExpectNear(p3.Exact({Srgb(0.8225), Srgb(0.0332), Srgb(0.0171)}), {1, 0, 0}, 0.01);
  ExpectNear(p3.Exact({0, 1, 0}), {0, 1, 0}, 0.02);  // beyond sRGB's green: clipped
  EXPECT_FALSE(p3.IsHdr());
}

TEST(ColourConversion, PicturesAreConvertedAsSingleColoursAre) {
  const io::VideoColours hlg{"bt2020nc", "arib-std-b67", "bt2020"}, pq{"bt2020nc", "smpte2084", "bt2020"};
  const io::VideoColours sdr{"bt709", "bt709", "bt709"}, wide{"bt709", "bt709", "smpte432"};
  for (const io::VideoColours& colours : {sdr, wide, hlg, pq}) {
    const io::ColourConversion conversion(colours, 1080);
    io::Image image = io::MakeImage(64 * 64, 64, 3);
    for (std::size_t i = 0; i < image.data.size() / 3; ++i) {
      const std::size_t levels[] = {i % 64, i / 64 % 64, i / 64 / 64};
      for (std::size_t k = 0; k < 3; ++k)
        image.data[3 * i + k] = static_cast<std::uint8_t>(255 * levels[k] / 63);
    }
    const io::Image before = image;
    conversion.Convert(&image);
    double worst = 0, sum = 0;
    for (std::size_t i = 0; i < image.data.size(); i += 3) {
      const std::uint8_t* from = &before.data[i];
      const Colour exact = conversion.Exact({from[0] / 255.0, from[1] / 255.0, from[2] / 255.0});
      for (std::size_t k = 0; k < 3; ++k) {
        const double off = std::fabs(255 * exact[k] - image.data[i + k]);
        worst = std::max(worst, off);
        sum += off;
      }
    }
    EXPECT_LT(worst, 3.5) << colours.transfer;
    EXPECT_LT(sum / static_cast<double>(image.data.size()), 0.3) << colours.transfer;
  }
}

// One frame of one colour as ffmpeg writes it: the decoded frame and, before it, the same as it was decoded.
std::pair<Colour, Colour> Read(const std::filesystem::path& path,
                               const std::string& source,
                               const std::vector<std::string>& arguments) {
  std::vector<std::string> argv = {
      io::FindProgram("ffmpeg").value().string(), "-nostdin", "-y", "-loglevel", "error", "-f", "lavfi"};
  argv.insert(argv.end(), {"-i", source, "-frames:v", "2"});
  argv.insert(argv.end(), arguments.begin(), arguments.end());
  argv.push_back(path.string());
  EXPECT_TRUE(io::RunProcess(argv, {.timeout_s = 60}).Ok());
  io::VideoReader reader(path);
  io::VideoFrame frame;
  std::pair<Colour, Colour> colours;
  for (Colour* colour : {&colours.second, &colours.first}) {
    EXPECT_TRUE(colour == &colours.first ? reader.Read(10000, &frame) : reader.ReadAsDecoded(10000, &frame));
    for (std::size_t i = 0; i < 3; ++i) (*colour)[i] = frame.image.Pixel(80, 60)[i];
  }
  return colours;
}

TEST(VideoColours, FramesHaveTheColoursThatTheFileMeans) {
  REQUIRE_PROGRAM("ffmpeg");
  const TempDir dir;
  const std::string source = "color=c=0x1080c0:size=160x120";
  for (const auto& [name, codec] : {std::pair("a.mkv", "ffv1"), std::pair("a.mp4", "libx264")}) {
    const auto [read, decoded] = Read(dir / name,
                                      source,
                                      {"-vf",
                                       "scale=out_color_matrix=bt709",
                                       "-pix_fmt",
                                       "yuv444p",
                                       "-colorspace",
                                       "bt709",
                                       "-qp",
                                       "0",
                                       "-c:v",
                                       codec});
    ExpectNear(read, {0x10, 0x80, 0xc0}, 2);
    EXPECT_GT(std::fabs(decoded[1] - 0x80), 5) << name;
  }
  // A white of 203 cd/m^2 in 10 bits: 64 + 0.75 * 876.
  const auto [read, decoded] = Read(dir / "hlg.mkv",
                                    "color=size=160x120",
                                    {"-vf",
                                     "format=yuv444p10le,geq=lum=721:cb=512:cr=512",
                                     "-c:v",
                                     "ffv1",
                                     "-colorspace",
                                     "bt2020nc",
                                     "-color_trc",
                                     "arib-std-b67",
                                     "-color_primaries",
                                     "bt2020"});
  ExpectNear(read, {230, 230, 230}, 2);
  ExpectNear(decoded, {191, 191, 191}, 2);
  const std::vector<std::string> notes = io::VideoReader(dir / "hlg.mkv").info().notes;
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_NE(notes[1].find("high dynamic range"), std::string::npos) << notes[1];
  // What nobody can probe says nothing.
  const io::VideoColours none = io::ReadVideoTags(dir / "absent.mp4").colours;
  EXPECT_EQ(none.matrix + none.transfer + none.primaries, "");
}

}  // namespace
