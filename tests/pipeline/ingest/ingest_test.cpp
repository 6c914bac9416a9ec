// The ingest stage as a user meets it: folders good and bad, names good and hostile, videos, exit codes.
#include "pipeline/ingest/ingest.h"
#include "io/base/json.h"

#include <sys/stat.h>

#include "io/base/error.h"
#include "io/image/image.h"
#include "pipeline/ingest/picture_source.h"
#include "tests/support/files/ingest_fixture.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;
using io::Json;

TEST_F(Ingest, PhotosBecomePicturesWithARecord) {
  for (int i = 0; i < 12; ++i) WritePhoto("img" + std::to_string(i) + ".jpg", View(i));
  ASSERT_EQ(Run(photos(), {"--max-size", "80"}), 0) << message_;
  ASSERT_EQ(frames_["kept"].size(), 12u);
  EXPECT_EQ(frames_["kept"][2]["name"], "img2.png");  // natural order: not img10
  EXPECT_TRUE(frames_["kept"][0]["focal_px"].is_null());
  for (const Json& entry : frames_["kept"]) {
    const io::Image image = io::ReadImage(run() / "ingest/images" / entry["name"].get<std::string>());
    EXPECT_EQ(image.width, 80);
    EXPECT_EQ(entry["width"], 80);
    EXPECT_EQ(entry["height"], 60);
    EXPECT_EQ(entry["camera_group"], 0);
  }
  const Json record = io::ParseJson(Bytes(run() / "ingest/ingest.json"));
  EXPECT_EQ(record["status"], "done");
  EXPECT_EQ(record["input_kind"], "photos");
  EXPECT_EQ(record["kept"], 12);

  ASSERT_EQ(Run(photos(), {"--max-size", "80"}), 0);
  EXPECT_TRUE(Says("up to date"));
}

TEST_F(Ingest, ResultsDoNotDependOnTheNumberOfThreads) {
  WritePhotos(8);
  ASSERT_EQ(Run(photos(), {"--threads", "1"}), 0);
  const Json one = frames_;
  const std::string picture = Bytes(run() / "ingest/images/img5.png");
  ASSERT_EQ(Run(photos(), {"--threads", "4", "--force"}), 0);
  EXPECT_EQ(frames_, one);
  EXPECT_EQ(Bytes(run() / "ingest/images/img5.png"), picture);
}

TEST_F(Ingest, EveryBadFileIsDroppedWithItsReason) {
  WritePhotos(8);
  const std::string whole = Bytes(photos() / "img1.jpg");
  WriteBytes(photos() / "cut.jpg", whole.substr(0, whole.size() / 2));
  WriteBytes(photos() / "text.jpg", "not a picture at all");
  WriteBytes(photos() / "empty.png", "");
  WriteBytes(photos() / "copy of 1.jpg", whole);
  WriteBytes(photos() / "notes.txt", "sunny day");
  WriteBytes(base_ / "outside.jpg", whole);
  fs::create_symlink(base_ / "outside.jpg", photos() / "escape.jpg");
  fs::create_symlink("loop.jpg", photos() / "loop.jpg");
  fs::create_symlink("img0.jpg", photos() / "zz_inside.jpg");
  fs::create_directory(photos() / "folder.jpg");
  ASSERT_EQ(mkfifo((photos() / "fifo.jpg").c_str(), 0600), 0);
  ASSERT_EQ(Run(photos()), 0) << message_;
  EXPECT_EQ(frames_["kept"].size(), 8u);
  EXPECT_NE(ReasonFor("cut.jpg").find("truncated"), std::string::npos);
  EXPECT_NE(ReasonFor("text.jpg").find("not a picture"), std::string::npos);
  EXPECT_NE(ReasonFor("empty.png").find("empty"), std::string::npos);
  EXPECT_NE(ReasonFor("img1.jpg").find("exact copy of copy of 1.jpg"), std::string::npos);
  EXPECT_NE(ReasonFor("notes.txt"), "");
  EXPECT_NE(ReasonFor("escape.jpg").find("outside"), std::string::npos);
  EXPECT_NE(ReasonFor("loop.jpg").find("nowhere"), std::string::npos);
  EXPECT_NE(ReasonFor("zz_inside.jpg").find("exact copy"), std::string::npos);
  EXPECT_NE(ReasonFor("folder.jpg"), "");
  EXPECT_NE(ReasonFor("fifo.jpg"), "");
  EXPECT_FALSE(fs::exists(run() / "ingest/images/cut.png"));
}

TEST_F(Ingest, HostileNamesBecomeSafeOnes) {
  const std::vector<std::string> names = {"my photo 1.jpg",
                                          "my_photo_1.jpg",
                                          "-rf.jpg",
                                          "--help.png",
                                          "$(touch pwned).jpg",
                                          "a;b'c\"d.jpg",
                                          "caf\xc3\xa9.jpg",
                                          "cafe\xcc\x81.jpg",
                                          "bad\xff.jpg",
                                          "CASE.jpg",
                                          "case.jpg"};
  for (std::size_t i = 0; i < names.size(); ++i) WritePhoto(names[i], View(static_cast<int>(i)));
  WritePhoto("line\nbreak.jpg", View(20));
  ASSERT_EQ(Run(photos()), 0) << message_;
  EXPECT_EQ(KeptNames().size(), names.size());
  for (const std::string& name : KeptNames()) {
    EXPECT_EQ(name.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-"),
              std::string::npos)
        << name;
    EXPECT_NE(name[0], '-');
    EXPECT_TRUE(fs::is_regular_file(run() / "ingest/images" / name));
  }
  EXPECT_TRUE(KeptNames().count("my_photo_1.png") == 1 && KeptNames().count("my_photo_1_2.png") == 1);
  EXPECT_NE(ReasonFor("line\\x0abreak.jpg").find("line break"), std::string::npos);
  EXPECT_FALSE(fs::exists("pwned"));
}

TEST_F(Ingest, BlurredAndRepeatedPhotosAreDropped) {
  for (int i = 0; i < 12; ++i) {
    cv::Mat view = View(i);
    if (i == 4) cv::blur(View(i), view, {15, 3});
    WritePhoto("img" + std::to_string(i) + ".jpg", view);
  }
  cv::Mat again = View(7);
  again += cv::Scalar::all(1);
  WritePhoto("img7b.jpg", again);
  ASSERT_EQ(Run(photos()), 0) << message_;
  EXPECT_EQ(frames_["kept"].size(), 11u);
  EXPECT_NE(ReasonFor("img4.jpg").find("blurred"), std::string::npos);
  EXPECT_TRUE(ReasonFor("img7.jpg").find("same as") != std::string::npos ||
              ReasonFor("img7b.jpg").find("same as") != std::string::npos);
  ASSERT_EQ(Run(photos(), {"--blur", "0"}), 0);
  EXPECT_EQ(frames_["kept"].size(), 12u);
}

TEST_F(Ingest, UnusableInputsEndWithTheDocumentedCode) {
  EXPECT_EQ(Run(photos()), 3);  // empty
  EXPECT_TRUE(Says("photos", "JPEG", "MP4"));
  EXPECT_FALSE(fs::exists(run()));
  EXPECT_EQ(Run(base_ / "absent"), 3);
  EXPECT_EQ(Run("/dev/zero"), 3);
  EXPECT_EQ(Run(base_ / std::string(4096, 'x')), 3);
  WriteBytes(photos() / "a.jpg", "text");
  EXPECT_EQ(Run(photos()), 3);
  EXPECT_TRUE(Says("a.jpg"));
  EXPECT_EQ(Run(photos() / "a.jpg"), 3);
  EXPECT_TRUE(Says("neither a picture nor a video")) << message_;
  WriteBytes(photos() / "clip.mp4", "ffconcat version 1.0\nfile x.mp4\n");
  EXPECT_EQ(Run(photos() / "clip.mp4"), 3);
  fs::remove_all(photos());
  fs::create_directory(photos());
  WritePhotos(2);
  EXPECT_EQ(Run(photos() / "img0.jpg"), 4);
  EXPECT_EQ(Run(photos()), 4);
  EXPECT_TRUE(Says("20"));
  EXPECT_FALSE(fs::exists(run() / "ingest"));
  EXPECT_EQ(Run(photos(), {"--max-size", "3"}), 2);
  EXPECT_EQ(Run(photos(), {"--frames", "9:3"}), 2);
}

TEST_F(Ingest, MostlyDamagedFoldersAreRefused) {
  WritePhotos(4);
  const std::string whole = Bytes(photos() / "img1.jpg");
  for (std::size_t i = 0; i < 5; ++i) {
    WriteBytes(photos() / ("cut" + std::to_string(i) + ".jpg"), whole.substr(0, whole.size() / 2 + i));
  }
  EXPECT_EQ(Run(photos()), 3);
  EXPECT_TRUE(Says("5 of 9")) << message_;
}

TEST_F(Ingest, APatternChoosesFiles) {
  WritePhotos(6);
  WritePhoto("other.jpg", View(9));
  ASSERT_EQ(Run(photos() / "img[0-3].jpg"), 0) << message_;
  EXPECT_EQ(KeptNames(), (std::set<std::string>{"img0.png", "img1.png", "img2.png", "img3.png"}));
}

TEST_F(Ingest, VideoFramesAreChosenByMotionAndSharpness) {
  // 30 still frames, then 60 frames that move by 3 pixels each; every fourth one is blurred.
  const auto frame = [&](int i) {
    cv::Mat view = texture_(cv::Rect(std::max(0, i - 30) * 3, 20, kWidth, kHeight)).clone();
    if (i % 4 == 0) cv::blur(view.clone(), view, {9, 9});
    return view;
  };
  ASSERT_EQ(Run(WriteVideo(90, frame), {"--max-frames", "20"}), 0) << message_;
  EXPECT_EQ(frames_["kept"].size(), 20u);
  EXPECT_EQ(frames_["dropped"].size(), 70u);
  int n_still = 0;
  double last = -1;
  for (const Json& entry : frames_["kept"]) {
    const int index = std::stoi(entry["source"].get<std::string>().substr(6));
    n_still += index < 30;
    EXPECT_NE(index % 4, 0);
    EXPECT_NEAR(entry["time_s"].get<double>(), index / 25.0, 2e-3);
    EXPECT_GT(entry["time_s"].get<double>(), last);
    last = entry["time_s"];
  }
  EXPECT_LE(n_still, 1);
  EXPECT_EQ(frames_["kept"][19]["name"].get<std::string>().size(), std::string("frame_000123.png").size());
  const Json record = io::ParseJson(Bytes(run() / "ingest/ingest.json"));
  EXPECT_EQ(record["input_kind"], "video");

  ASSERT_EQ(Run(base_ / "clip.avi", {"--frames", "40:59"}), 0) << message_;
  EXPECT_EQ(frames_["kept"].size() + frames_["dropped"].size(), 20u);
}

TEST_F(Ingest, ASubjectThatTurnsBeforeAStillBackgroundIsMotion) {
  const cv::Rect subject(40, 30, 80, 70);  // 29 % of the picture
  const auto frame = [&](int i) {
    cv::Mat view = View(0);
    texture_(cv::Rect(400 + i, 100, subject.width, subject.height)).copyTo(view(subject));
    return view;
  };
  ASSERT_EQ(Run(WriteVideo(60, frame)), 0) << message_;
  EXPECT_GE(frames_["kept"].size(), 15u);
}

TEST_F(Ingest, VideosWithoutMotionOrLightAreRefused) {
  EXPECT_EQ(Run(WriteVideo(20, [&](int) { return View(0); })), 4);
  EXPECT_TRUE(Says("no motion")) << message_;
  EXPECT_EQ(Run(WriteVideo(20, [&](int) { return cv::Mat::zeros(kHeight, kWidth, CV_8UC3); })), 4);
  EXPECT_TRUE(Says("no light")) << message_;
}

TEST_F(Ingest, AHalfCopiedVideoIsUsedAndNamed) {
  const fs::path clip =
      WriteVideo(40, [&](int i) { return texture_(cv::Rect(6 * i, 20, kWidth, kHeight)).clone(); });
  fs::resize_file(clip, fs::file_size(clip) / 2);
  ASSERT_EQ(Run(clip), 0) << message_;
  EXPECT_TRUE(Says("incomplete", "of 40", "could be decoded")) << message_;
}

TEST_F(Ingest, AFolderWithOneVideoIsThatVideo) {
  const fs::path clip =
      WriteVideo(40, [&](int i) { return texture_(cv::Rect(6 * i, 20, kWidth, kHeight)).clone(); });
  fs::rename(clip, photos() / "clip.avi");
  ASSERT_EQ(Run(photos()), 0) << message_;
  EXPECT_TRUE(frames_["kept"][0].contains("time_s"));
  fs::copy(photos() / "clip.avi", photos() / "clip2.avi");
  EXPECT_EQ(Run(photos()), 3);
  EXPECT_TRUE(Says("2 videos and no photo")) << message_;
}

TEST_F(Ingest, FramesBehindTheEndOfAVideoAreNamed) {
  const fs::path clip =
      WriteVideo(20, [&](int i) { return texture_(cv::Rect(6 * i, 20, kWidth, kHeight)).clone(); });
  EXPECT_EQ(Run(clip, {"--frames", "50:60"}), 3);
  EXPECT_TRUE(Says("20 frames can be decoded, none from frame 50 on")) << message_;
}

TEST(PictureSelection, DropsAtMostThirtyPercentAsBlurred) {
  std::vector<double> sharpness(20, 1.0);
  for (const std::size_t i : {0u, 2u, 5u, 7u, 10u, 12u, 15u, 17u})
    sharpness[i] = 0.01 + 0.001 * static_cast<double>(i);
  const std::vector<bool> blurred = pipeline::FindBlurred(sharpness, {});
  EXPECT_EQ(std::count(blurred.begin(), blurred.end(), true), 6);
  EXPECT_TRUE(blurred[0]);
  EXPECT_FALSE(blurred[17]);
}

// Mean differences are below min_difference in both; a subject on a turntable changes a small part by much.
TEST(PictureSelection, ATremorIsNoNewPictureButATurningSubjectIs) {
  const pipeline::SelectionOptions options;
  std::vector<pipeline::PictureLook> tremor(6), turning(6);
  for (std::size_t i = 0; i < tremor.size(); ++i) {
    tremor[i].sharpness = turning[i].sharpness = 1;
    for (std::size_t cell = 0; cell < 1024; ++cell) {
      tremor[i].thumbnail[cell] = static_cast<std::uint8_t>(100 + (cell % 16 == 0 && i % 2 ? 15 : 0));
      turning[i].thumbnail[cell] = static_cast<std::uint8_t>(100 + (cell / 16 == i ? 30 : 0));
    }
  }
  const std::vector<std::string> names(6, "x");
  const auto n_dropped = [&](const std::vector<pipeline::PictureLook>& looks) {
    const std::vector<std::string> reasons = pipeline::JudgePhotos(looks, names, options);
    return std::count_if(reasons.begin(), reasons.end(), [](const auto& reason) { return !reason.empty(); });
  };
  ASSERT_LT(io::Difference(turning[0].thumbnail, turning[1].thumbnail), options.min_difference);
  EXPECT_EQ(n_dropped(tremor), 5);
  EXPECT_EQ(n_dropped(turning), 0);
}

TEST(PictureSelection, FrameStepsHaveEqualLength) {
  // The camera rests, moves slowly, then fast.
  std::vector<double> path(50, 0.0), sharpness;
  for (int i = 0; i < 100; ++i) path.push_back(path.back() + 0.002);
  for (int i = 0; i < 39; ++i) path.push_back(path.back() + 0.01);
  for (std::size_t i = 0; i < path.size(); ++i) sharpness.push_back(1.0);
  const auto verdicts = pipeline::JudgeFrames(path, sharpness, 0, {.frame_step = 0.02});
  double last = -1;
  int n_kept = 0;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (!verdicts[i].kept) {
      EXPECT_FALSE(verdicts[i].reason.empty());
      continue;
    }
    if (last >= 0) {
      EXPECT_NEAR(path[i] - last, 0.02, 0.0101);
    }
    last = path[i];
    ++n_kept;
  }
  EXPECT_EQ(n_kept, 30);
}

TEST(PictureSource, WhatIsNoFileOrTooLargeIsNotRead) {
  const TempDir dir;
  EXPECT_ERROR(pipeline::ReadPictureFile(dir.path()), io::ExitCode::kBadInput, "not a regular file");
  WriteText(dir / "huge.jpg", "");
  fs::resize_file(dir / "huge.jpg", (std::uintmax_t{1} << 30) + 1);  // without data on disk
  EXPECT_ERROR(pipeline::ReadPictureFile(dir / "huge.jpg"), io::ExitCode::kBadInput, "larger than 1 GiB");
}

TEST(PictureSource, PrintableNamesAreValidUtf8) {
  EXPECT_EQ(pipeline::PrintableName("caf\xc3\xa9 1"), "caf\xc3\xa9 1");
  EXPECT_EQ(pipeline::PrintableName("a\nb\xff\xc3"), "a\\x0ab\\xff\\xc3");
  EXPECT_EQ(pipeline::PrintableName("\xc0\xaf\xed\xa0\x80"), "\\xc0\\xaf\\xed\\xa0\\x80");
}

}  // namespace
