// Masks of photos as a user gives them: beside which picture they end up, and which faults are named.
#include "pipeline/ingest/photo_masks.h"
#include "io/base/json.h"

#include "io/image/image.h"
#include "io/image/mask.h"
#include "tests/support/files/ingest_fixture.h"

namespace {

namespace fs = std::filesystem;
using io::Json;

class IngestMasks : public Ingest {
 protected:
  fs::path masks() const { return base_ / "masks"; }
  // White from column `from` on.
  void WriteMask(const std::string& name, int from, int width = kWidth, int height = kHeight) const {
    cv::Mat mask(height, width, CV_8U, cv::Scalar(0));
    if (from < width) mask.colRange(from, width).setTo(255);
    fs::create_directories(masks());
    ASSERT_TRUE(cv::imwrite((masks() / name).string(), mask));
  }
  int RunMasked(std::vector<std::string> flags = {}) {
    flags.insert(flags.end(), {"--masks", masks().string()});
    return Run(photos(), flags);
  }
};

TEST_F(IngestMasks, AreWrittenBesideTheirPicturesAtTheirSize) {
  WritePhotos(8);
  for (int i = 0; i < 4; ++i) WriteMask("img" + std::to_string(i) + ".png", 40);
  WriteMask("img4.jpg.png", 100);  // COLMAP's way
  WriteMask("img4.png", 0);
  WriteMask("img5.bmp.tiff", 0);  // of no photo
  WriteMask("img6.png", kWidth);  // black
  ASSERT_EQ(RunMasked({"--max-size", "80"}), 0) << message_;
  EXPECT_TRUE(Says("masks", "5 of 7", "68 %", "the other")) << message_;
  EXPECT_NE(ReasonFor("img6.jpg").find("mask uses no pixel"), std::string::npos);
  int n_masks = 0;
  for (const Json& entry : frames_["kept"]) {
    const std::string name = entry["name"];
    const fs::path path = run() / "ingest/masks" / name;
    EXPECT_EQ(fs::exists(path), entry.contains("mask")) << name;
    if (!fs::exists(path)) continue;
    ++n_masks;
    const io::Mask mask = io::ReadMask(path, 80, 60);
    for (std::size_t p = 0; p < 80 * 60; ++p)
      EXPECT_EQ(mask.Uses(p), p % 80 >= (name == "img4.png" ? 50 : 20)) << name;
  }
  EXPECT_EQ(n_masks, 5);
  EXPECT_FALSE(fs::exists(run() / "ingest/images/img6.png"));

  ASSERT_EQ(RunMasked({"--max-size", "80"}), 0);
  EXPECT_TRUE(Says("up to date"));
  WriteMask("img2.png", 41);
  ASSERT_EQ(RunMasked({"--max-size", "80"}), 0);
  EXPECT_FALSE(Says("up to date"));
  ASSERT_EQ(Run(photos(), {"--max-size", "80"}), 0);
  EXPECT_FALSE(Says("up to date"));
  EXPECT_FALSE(fs::exists(run() / "ingest/masks"));
  EXPECT_EQ(frames_["kept"].size(), 8u);
}

TEST_F(IngestMasks, AVideoIsNoMask) {
  WritePhotos(8);
  fs::create_directories(masks());
  fs::rename(WriteVideo(5, [&](int i) { return View(i); }), masks() / "clip.avi");
  EXPECT_EQ(RunMasked(), 3);
  EXPECT_TRUE(Says("holds a video, not masks")) << message_;
}

TEST_F(IngestMasks, OfDroppedPicturesAreDroppedToo) {
  WritePhotos(6);
  WritePhoto("img3b.jpg", View(3) + cv::Scalar::all(1));
  for (const char* name : {"img3.png", "img3b.png"}) WriteMask(name, 40);
  ASSERT_EQ(RunMasked(), 0) << message_;
  EXPECT_EQ(frames_["kept"].size(), 6u);
  EXPECT_EQ(std::distance(fs::directory_iterator(run() / "ingest/masks"), {}), 1);
}

TEST_F(IngestMasks, FaultsAreNamedBeforeAnythingIsUsedWhole) {
  WritePhotos(4);
  EXPECT_EQ(RunMasked(), 2);
  EXPECT_TRUE(Says("--masks", masks().string(), "no folder")) << message_;
  EXPECT_EQ(Run(photos(), {"--masks", photos().string()}), 2);
  EXPECT_TRUE(Says("--masks", photos().string(), "folder of the photos")) << message_;
  WriteMask("other.png", 0);
  EXPECT_EQ(RunMasked(), 3);
  EXPECT_TRUE(Says(masks().string(), "none of its 1", "img0.jpg", "img0.png")) << message_;
  EXPECT_FALSE(fs::exists(run()));
  WriteMask("img1.png", 0, kHeight, kWidth);
  EXPECT_EQ(RunMasked(), 3);
  EXPECT_TRUE(Says("img1.png", "mask is 120x160", "photo 160x120")) << message_;
  WriteMask("img1.png", 0);
  WriteMask("img1.tiff", 0);
  EXPECT_EQ(RunMasked(), 3);
  EXPECT_TRUE(Says("img1.png", "img1.tiff", "same photo")) << message_;
  fs::remove(masks() / "img1.tiff");
  const std::string whole = Bytes(masks() / "img1.png");
  WriteBytes(masks() / "img1.png", whole.substr(0, whole.size() / 2));
  EXPECT_EQ(RunMasked(), 3);
  EXPECT_TRUE(Says("img1.png")) << message_;
  WriteBytes(masks() / "img1.png", "no picture");
  EXPECT_EQ(RunMasked(), 3);
  EXPECT_TRUE(Says("img1.png", "not a picture")) << message_;
  const fs::path video = WriteVideo(9, [&](int i) { return View(i); });
  EXPECT_EQ(Run(video, {"--masks", masks().string()}), 2);
  EXPECT_TRUE(Says("--masks", "video", "ffmpeg")) << message_;
}

// A mask shows the photo upright; one made from the stored pixels is turned as they are.
TEST_F(IngestMasks, OfATurnedPhotoMayBeUprightOrStored) {
  io::Photo photo;
  photo.image = io::MakeImage(30, 40, 3);  // upright, at half of the full size
  photo.full_width = 60, photo.full_height = 80;
  photo.orientation = 6;  // stored row 0 is the right edge
  WriteMask("upright.png", 40, 60, 80);
  cv::Mat stored(60, 80, CV_8U, cv::Scalar(0));
  stored.rowRange(0, 20).setTo(255);
  ASSERT_TRUE(cv::imwrite((masks() / "stored.png").string(), stored));
  for (const char* name : {"upright.png", "stored.png"}) {
    const io::Mask mask = pipeline::ReadPhotoMask(masks() / name, photo);
    ASSERT_EQ(mask.width, 30);
    ASSERT_EQ(mask.height, 40);
    for (std::size_t p = 0; p < 1200; ++p) EXPECT_EQ(mask.Uses(p), p % 30 >= 20) << name << " " << p;
  }
}

}  // namespace
