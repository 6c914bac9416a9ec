// What lies over every picture: bars are cut off, marks masked out, and what merely hardly changes stays.
#include "pipeline/ingest/overlay.h"

#include "io/image/image.h"
#include "io/image/mask.h"
#include "pipeline/ingest/overlay_removal.h"
#include "tests/support/files/ingest_fixture.h"

namespace {

namespace fs = std::filesystem;

constexpr int kPictures = 24;

// Pictures of noise, each its own, in blocks of 4 pixels.
std::vector<io::Image> Noise(int n = kPictures) {
  std::vector<io::Image> pictures;
  cv::RNG rng(5);
  for (int i = 0; i < n; ++i) {
    cv::Mat blocks(kHeight / 4, kWidth / 4, CV_8UC3), mat;
    rng.fill(blocks, cv::RNG::UNIFORM, 60, 255);
    cv::resize(blocks, mat, {kWidth, kHeight}, 0, 0, cv::INTER_NEAREST);
    pictures.push_back({kWidth, kHeight, 3, {mat.datastart, mat.dataend}});
  }
  return pictures;
}

cv::Mat Mat(io::Image* picture) { return {picture->height, picture->width, CV_8UC3, picture->data.data()}; }

void Paint(const cv::Rect& rect, const cv::Scalar& colour, std::vector<io::Image>* pictures) {
  for (io::Image& picture : *pictures) Mat (&picture)(rect).setTo(colour);
}

pipeline::Overlay Find(const std::vector<io::Image>& pictures) { return pipeline::FindOverlay(pictures, 2); }

bool IsEmpty(const pipeline::Overlay& overlay) {
  return !overlay.bars.Any() && overlay.mask.used.empty() && overlay.covered == 0;
}

TEST(Overlay, BarsAreFoundOnTheSidesThatHaveThem) {
  auto pictures = Noise();
  Paint({0, 0, 30, kHeight}, {0, 0, 0}, &pictures);
  Paint({0, 113, kWidth, 7}, {20, 10, 20}, &pictures);
  const pipeline::Overlay overlay = Find(pictures);
  EXPECT_EQ(overlay.bars.left, 30);
  EXPECT_EQ(overlay.bars.bottom, 7);
  EXPECT_EQ(overlay.bars.right, 0);
  EXPECT_EQ(overlay.bars.top, 0);
  EXPECT_TRUE(overlay.mask.used.empty());
  // One line more, which may be half of a bar, and rounded up.
  const pipeline::Overlay resized = pipeline::ResizedOverlay(overlay, kWidth, kHeight, 200, 150);
  EXPECT_EQ(resized.bars.left, 39);
  EXPECT_EQ(resized.bars.bottom, 10);
  EXPECT_EQ(resized.bars.top, 0);
}

TEST(Overlay, WhatFadesIntoTheDarkIsNoBar) {
  auto pictures = Noise();
  Paint({0, 0, 30, kHeight}, {0, 0, 0}, &pictures);
  // Over more than half of its length what follows is dark in most of the pictures.
  Paint({30, 0, 10, 70}, {15, 15, 15}, &pictures);
  EXPECT_FALSE(Find(pictures).bars.Any());
}

TEST(Overlay, GreyBordersStay) {
  auto pictures = Noise();
  Paint({0, 0, 30, kHeight}, {55, 55, 55}, &pictures);
  EXPECT_FALSE(Find(pictures).bars.Any());
}

TEST(Overlay, AMarkIsLeftOutAndNothingElse) {
  auto pictures = Noise();
  const cv::Rect mark(70, 60, 40, 12);
  Paint(mark, {250, 200, 30}, &pictures);
  const pipeline::Overlay overlay = Find(pictures);
  EXPECT_FALSE(overlay.bars.Any());
  ASSERT_EQ(overlay.mask.used.size(), static_cast<std::size_t>(kWidth * kHeight));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      EXPECT_EQ(overlay.mask.Uses(static_cast<std::size_t>(y * kWidth + x)), !mark.contains({x, y}))
          << x << ' ' << y;
    }
  }
  EXPECT_NEAR(overlay.covered, mark.area() / double{kWidth * kHeight}, 1e-12);
  // At twice the size with its margin of 5 pixels.
  const pipeline::Overlay resized =
      pipeline::ResizedOverlay(overlay, kWidth, kHeight, 2 * kWidth, 2 * kHeight);
  const cv::Rect left_out(130, 110, 100, 44);
  for (int y = 0; y < 2 * kHeight; ++y) {
    for (int x = 0; x < 2 * kWidth; ++x) {
      EXPECT_EQ(resized.mask.Uses(static_cast<std::size_t>(y * 2 * kWidth + x)), !left_out.contains({x, y}));
    }
  }
}

TEST(Overlay, AMarkMayBeMissingInATenthOfThePictures) {
  for (const int missing : {2, 3}) {
    auto pictures = Noise();
    auto bare = Noise(missing);
    Paint({110, 90, 40, 12}, {250, 200, 30}, &pictures);
    std::copy(bare.begin(), bare.end(), pictures.begin());
    EXPECT_EQ(Find(pictures).mask.used.empty(), missing == 3);
  }
}

TEST(Overlay, AWhiteSkyIsNone) {
  // The skyline wanders from picture to picture, by as much as a hand moves.
  auto pictures = Noise();
  for (int i = 0; i < kPictures; ++i)
    Mat (&pictures[static_cast<std::size_t>(i)])({0, 0, kWidth, 30 + i}).setTo(cv::Scalar(254, 254, 254));
  EXPECT_TRUE(IsEmpty(Find(pictures)));
}

TEST(Overlay, ABackgroundIsNone) {
  for (const bool is_background : {true, false}) {
    auto pictures = Noise();
    Paint({0, 0, kWidth, is_background ? 70 : 50}, {250, 200, 30}, &pictures);
    EXPECT_EQ(IsEmpty(Find(pictures)), is_background);
  }
}

TEST(Overlay, ABackdropAroundABallIsNone) {
  // The ball turns on the spot, and fills more than half of the picture.
  for (const int right : {kWidth, kWidth - 1}) {
    auto pictures = Noise();
    for (io::Image& picture : pictures) {
      cv::Mat backdrop(kHeight, kWidth, CV_8UC3, cv::Scalar(250, 200, 30)), ball(kHeight, kWidth, CV_8U);
      ball.setTo(0);
      cv::ellipse(ball, {80, 60}, {70, 52}, 0, 0, 360, 255, cv::FILLED);
      ball.colRange(right, kWidth).setTo(255);  // with it the backdrop reaches three sides only
      Mat(&picture).copyTo(backdrop, ball);
      backdrop.copyTo(Mat(&picture));
    }
    EXPECT_EQ(IsEmpty(Find(pictures)), right == kWidth);
  }
}

TEST(Overlay, SpecksStay) {
  for (const int height : {3, 4}) {
    auto pictures = Noise();
    Paint({70, 60, 3, height}, {250, 200, 30}, &pictures);
    EXPECT_EQ(IsEmpty(Find(pictures)), height == 3);
  }
}

TEST(Overlay, PicturesOfAFewPixelsHaveNone) {
  // Bars of 4 of 10 pixels, and the lines next to them, leave nothing.
  for (const int side : {3, 4}) {
    io::Image picture = io::MakeImage(10, 10, 3);
    Mat(&picture).colRange(side, 10 - side).setTo(200);
    EXPECT_EQ(Find(std::vector(kPictures, picture)).bars.left, side == 3 ? 3 : 0);
  }
}

TEST(Overlay, FewPicturesTellNothing) {
  for (const int n : {19, 20}) {
    auto pictures = Noise(n);
    Paint({110, 90, 40, 12}, {250, 200, 30}, &pictures);
    Paint({0, 0, 30, kHeight}, {0, 0, 0}, &pictures);
    EXPECT_EQ(IsEmpty(Find(pictures)), n == 19);
  }
}

class IngestOverlay : public Ingest {
 protected:
  // A view with bars to its left and right and a mark at its lower end.
  cv::Mat Marked(int i) const {
    cv::Mat view = View(i);
    view.colRange(0, 32).setTo(0);
    view.colRange(128, kWidth).setTo(0);
    view(mark_).setTo(cv::Scalar(40, 220, 250));
    return view;
  }
  // Pixels that the mask of a kept picture leaves out.
  cv::Mat LeftOut(const std::string& name, int width) const {
    const io::Mask mask = io::ReadMask(run() / "ingest/masks" / name, width, kHeight);
    return cv::Mat(mask.used, true).reshape(1, kHeight) == 0;
  }

  const cv::Rect mark_{70, 96, 40, 12};
};

TEST_F(IngestOverlay, PhotosLoseTheirBarsAndAMaskLeavesTheMarkOut) {
  for (int i = 0; i < kPictures; ++i) WritePhoto("img" + std::to_string(i) + ".jpg", Marked(i));
  fs::create_directories(base_ / "masks");
  cv::Mat own(kHeight, kWidth, CV_8U, cv::Scalar(255));
  own.colRange(40, 50).setTo(0);
  ASSERT_TRUE(cv::imwrite((base_ / "masks/img3.png").string(), own));
  ASSERT_EQ(Run(photos(), {"--masks", (base_ / "masks").string()}), 0) << message_;
  EXPECT_TRUE(Says("black bars around 24 pictures are cut off", "x 120 pixels", "24 pictures never change"))
      << message_;
  ASSERT_EQ(frames_["kept"].size(), static_cast<std::size_t>(kPictures));
  for (const io::Json& entry : frames_["kept"]) {
    const std::string name = entry["name"];
    const int width = entry["width"];
    // 32 columns on either side, give or take the one that the codec blurs.
    EXPECT_GE(width, 94);
    EXPECT_LE(width, 96);
    EXPECT_TRUE(entry.contains("mask"));
    const io::Image picture = io::ReadImage(run() / "ingest/images" / name);
    EXPECT_EQ(picture.width, width);
    EXPECT_EQ(picture.height, kHeight);
    const cv::Mat left_out = LeftOut(name, width);
    const int cut = (kWidth - width) / 2;
    EXPECT_EQ(cv::countNonZero(left_out(mark_ - cv::Point(cut, 0))), mark_.area()) << name;
    EXPECT_EQ(left_out.at<std::uint8_t>(40, 10) != 0, name == "img3.png") << name;
    EXPECT_EQ(left_out.at<std::uint8_t>(40, 30), 0) << name;
  }
}

TEST_F(IngestOverlay, ThirtyPhotosOfAllTheCaptureAreCompared) {
  // Every second one of sixty, and these have the mark.
  for (int i = 0; i < 60; ++i) {
    cv::Mat view = texture_(cv::Rect(25 * i, 20, kWidth, kHeight)).clone();
    if (i % 2 == 0) view(mark_).setTo(cv::Scalar(40, 220, 250));
    WritePhoto("img" + std::to_string(i) + ".jpg", view);
  }
  ASSERT_EQ(Run(photos()), 0) << message_;
  EXPECT_TRUE(Says("60 pictures never change")) << message_;
  EXPECT_EQ(pipeline::OverlayRemoval::Bytes(60, 1600), std::size_t{30 * 3 * 1024 * 1024});
  EXPECT_EQ(pipeline::OverlayRemoval::Bytes(20, 100), std::size_t{20 * 3 * 100 * 100});
}

TEST_F(IngestOverlay, VideosAreTreatedAlike) {
  const fs::path video = WriteVideo(100, [&](int i) {
    cv::Mat view = texture_(cv::Rect(12 * i, 20, kWidth, kHeight)).clone();
    view(mark_).setTo(cv::Scalar(40, 220, 250));
    return view;
  });
  ASSERT_EQ(Run(video, {"--max-frames", "30"}), 0) << message_;
  EXPECT_TRUE(Says("pictures never change while the rest does")) << message_;
  for (const std::string& name : KeptNames())
    EXPECT_GE(cv::countNonZero(LeftOut(name, kWidth)(mark_)), mark_.area()) << name;
}

TEST_F(IngestOverlay, AVideoIsChosenByWhatItShowsBetweenItsBars) {
  // Content of half the width moves by 1.25 % of it per frame; frames are kept every 2 %.
  const auto frame = [&](int i, bool has_bars) {
    cv::Mat view(kHeight, kWidth, CV_8UC3, cv::Scalar(0, 0, 0));
    const cv::Mat content = texture_(cv::Rect(2 * i, 20, kWidth, kHeight));
    if (!has_bars) return cv::Mat(content.clone());
    cv::resize(content, view.colRange(40, 120), {80, kHeight}, 0, 0, cv::INTER_AREA);
    return view;
  };
  std::vector<std::size_t> kept;
  for (const bool has_bars : {false, true}) {
    const fs::path video = WriteVideo(120, [&](int i) { return frame(i, has_bars); });
    ASSERT_EQ(Run(video, {"--max-frames", "1000", "--force"}), 0) << message_;
    EXPECT_EQ(Says("black bars"), has_bars) << message_;
    kept.push_back(KeptNames().size());
  }
  EXPECT_NEAR(static_cast<double>(kept[1]), static_cast<double>(kept[0]), 0.1 * static_cast<double>(kept[0]));
}

TEST_F(IngestOverlay, StaysWhereTheUserWantsIt) {
  for (int i = 0; i < kPictures; ++i) WritePhoto("img" + std::to_string(i) + ".jpg", Marked(i));
  ASSERT_EQ(Run(photos(), {"--no-find-overlay"}), 0) << message_;
  EXPECT_EQ(frames_["kept"][0]["width"], kWidth);
  EXPECT_FALSE(fs::exists(run() / "ingest/masks"));
}

TEST_F(IngestOverlay, TransparencySaysItselfWhatCounts) {
  for (int i = 0; i < kPictures; ++i) {
    cv::Mat view;
    cv::cvtColor(Marked(i), view, cv::COLOR_BGR2BGRA);
    view.rowRange(0, 20).setTo(cv::Scalar(0, 0, 0, 0));
    ASSERT_TRUE(cv::imwrite((photos() / ("img" + std::to_string(i) + ".png")).string(), view));
  }
  ASSERT_EQ(Run(photos()), 0) << message_;
  EXPECT_EQ(frames_["kept"][0]["width"], kWidth);
  EXPECT_FALSE(fs::exists(run() / "ingest/masks"));
}

TEST_F(IngestOverlay, PhotosWithoutAnyAreLeftAlone) {
  WritePhotos(kPictures);
  ASSERT_EQ(Run(photos()), 0) << message_;
  EXPECT_FALSE(Says("never change"));
  EXPECT_FALSE(Says("bars"));
  EXPECT_FALSE(fs::exists(run() / "ingest/masks"));
}

}  // namespace
