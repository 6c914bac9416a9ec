// Masks: which grey levels are used, how they shrink, what is written, and what is refused.
#include "io/image/mask.h"

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace {

io::Image Grey(int width, int height, int level) {
  io::Image image = io::MakeImage(width, height, 3);
  std::fill(image.data.begin(), image.data.end(), static_cast<std::uint8_t>(level));
  return image;
}

TEST(Mask, Level128IsTheFirstThatIsUsed) {
  for (int level = 0; level < 256; ++level) {
    const io::Mask mask = io::MaskFromImage(Grey(2, 3, level));
    EXPECT_EQ(mask.UsedCount(), level >= 128 ? 6u : 0u) << level;
    for (std::size_t p = 0; p < 6; ++p) EXPECT_EQ(mask.Uses(p), level >= 128) << level;
  }
  EXPECT_TRUE(io::Mask().Uses(17));
}

TEST(Mask, ColourCountsByLumaAndTransparencyIsBlack) {
  io::Image image = io::MakeImage(5, 1, 4);
  const std::uint8_t colours[5][4] = {{255, 0, 0, 255},      // luma 76
                                      {0, 255, 0, 255},      // 150
                                      {255, 255, 255, 127},  // on black: 127
                                      {255, 255, 255, 128},  // 128
                                      {255, 255, 255, 0}};
  for (int x = 0; x < 5; ++x) std::copy_n(colours[x], 4, image.Pixel(x, 0));
  EXPECT_EQ(io::MaskFromImage(image).used, (std::vector<std::uint8_t>{0, 255, 0, 255, 0}));
}

TEST(Mask, ShrinksByArea) {
  // Blocks of 2x2 with 0 to 4 used pixels: half of the area suffices.
  io::Mask mask{10, 2, std::vector<std::uint8_t>(20, 0)};
  for (int block = 0; block < 5; ++block) {
    for (int k = 0; k < block; ++k) mask.used[static_cast<std::size_t>(k / 2 * 10 + 2 * block + k % 2)] = 255;
  }
  const io::Mask half = io::ShrinkMask(mask, 5, 1);
  EXPECT_EQ(half.width, 5);
  EXPECT_EQ(half.height, 1);
  EXPECT_EQ(half.used, (std::vector<std::uint8_t>{0, 0, 255, 255, 255}));
  EXPECT_EQ(io::ShrinkMask(mask, 10, 2).used, mask.used);
  // Columns 0 to 6 of 10 are used: of thirds, the first two whole, the last for 1/10 of its area.
  io::Mask columns{10, 4, {}};
  for (int i = 0; i < 40; ++i) columns.used.push_back(i % 10 < 7 ? 255 : 0);
  EXPECT_EQ(io::ShrinkMask(columns, 3, 1).used, (std::vector<std::uint8_t>{255, 255, 0}));
}

TEST(Mask, IsWrittenAsOneGreyChannelAndComesBack) {
  const TempDir dir;
  io::Mask mask{7, 5, std::vector<std::uint8_t>(35, 0)};
  for (std::size_t i = 0; i < 35; i += 3) mask.used[i] = 255;
  io::WriteMask(dir / "masks/a.png", mask);
  EXPECT_EQ(ReadText(dir / "masks/a.png").at(25), 0) << "PNG's colour type: grey";
  EXPECT_EQ(io::ReadMask(dir / "masks/a.png", 7, 5).used, mask.used);
}

TEST(Mask, WrongSizesAndBlackMasksAreNamed) {
  const TempDir dir;
  io::WriteImage(dir / "black.png", Grey(4, 3, 127));
  io::WriteImage(dir / "white.png", Grey(4, 3, 128));
  EXPECT_EQ(io::ReadMask(dir / "white.png", 4, 3).UsedCount(), 12u);
  EXPECT_ERROR(io::ReadMask(dir / "white.png", 3, 4),
               io::ExitCode::kBadInput,
               "white.png",
               "mask is 4x3",
               "picture 3x4");
  EXPECT_ERROR(io::ReadMask(dir / "black.png", 4, 3), io::ExitCode::kBadInput, "black.png", "no pixel");
  EXPECT_ERROR(io::ReadMask(dir / "gone.png", 4, 3), io::ExitCode::kBadInput, "gone.png");
}

}  // namespace
