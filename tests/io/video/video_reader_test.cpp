// io/video/video_reader.h and io/video/camera_motion.h, on videos that OpenCV writes here.
#include "io/video/video_reader.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "io/base/error.h"
#include "io/process/process.h"
#include "io/video/camera_motion.h"
#include "tests/support/programs/require_program.h"

namespace {

namespace fs = std::filesystem;
constexpr int kWidth = 320, kHeight = 240, kFrames = 20;
constexpr int kStep = 4;  // [px] the scene moves left per frame

class VideoReader : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("video_reader_test_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    cv::Mat noise(kHeight / 8, kWidth, CV_8UC3);
    cv::setRNGSeed(7);
    cv::randu(noise, 0, 255);
    cv::resize(noise, texture_, {kWidth * 4, kHeight}, 0, 0, cv::INTER_CUBIC);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Frame i: its number as the brightness of a bar at the top, above a texture moving by `step` pixels.
  cv::Mat Frame(int i, int step) const {
    cv::Mat frame = texture_(cv::Rect(i * step, 0, kWidth, kHeight)).clone();
    frame.rowRange(0, 16).setTo(cv::Scalar::all(20 + 10 * i));
    return frame;
  }

  fs::path Write(const std::string& name, const char* fourcc, int step = kStep) const {
    const fs::path path = folder_ / name;
    cv::VideoWriter writer(path.string(),
                           cv::CAP_FFMPEG,
                           cv::VideoWriter::fourcc(fourcc[0], fourcc[1], fourcc[2], fourcc[3]),
                           25,
                           {kWidth, kHeight});
    EXPECT_TRUE(writer.isOpened());
    for (int i = 0; i < kFrames; ++i) writer.write(Frame(i, step));
    return path;
  }

  fs::path WriteBytes(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }

  static std::string Bytes(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  static std::string RefusalOf(const fs::path& path) {
    try {
      io::VideoReader reader(path);
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), io::ExitCode::kBadInput);
      return error.what();
    }
    return "";
  }

  fs::path folder_;
  cv::Mat texture_;
};

TEST_F(VideoReader, FramesComeInOrderWithTheirTimes) {
  for (const fs::path& path : {Write("a.mp4", "mp4v"), Write("a.avi", "MJPG"), Write("a.mkv", "mp4v")}) {
    io::VideoReader reader(path);
    EXPECT_EQ(reader.info().container_frames, kFrames);
    io::VideoFrame frame;
    for (int i = 0; i < kFrames; ++i) {
      if (i % 3 == 1) {
        ASSERT_TRUE(reader.Skip());
        continue;
      }
      ASSERT_TRUE(reader.Read(10000, &frame));
      EXPECT_EQ(frame.index, i);
      EXPECT_NEAR(frame.time_s, i / 25.0, 2e-3);
      EXPECT_EQ(frame.image.width, kWidth);
      EXPECT_NEAR(frame.image.Pixel(200, 6)[0], 20 + 10 * i, 6);
    }
    EXPECT_FALSE(reader.Read(10000, &frame));
  }
}

TEST_F(VideoReader, FramesAreRgbAndLimitedInSize) {
  const fs::path path = folder_ / "red.avi";
  cv::VideoWriter writer(
      path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {kWidth, kHeight});
  writer.write(cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar(10, 20, 220)));
  writer.release();
  io::VideoReader reader(path);
  io::VideoFrame frame;
  ASSERT_TRUE(reader.Read(160, &frame));
  EXPECT_EQ(frame.image.width, 160);
  EXPECT_EQ(frame.image.height, 120);
  EXPECT_NEAR(frame.image.Pixel(80, 60)[0], 220, 8);
  EXPECT_NEAR(frame.image.Pixel(80, 60)[2], 10, 8);
}

TEST_F(VideoReader, RotationIsAppliedOnce) {
  // The matrix of the track header (ISO/IEC 14496-12, 8.3.2), replaced by a turn of 90 degrees clockwise.
  std::string bytes = Bytes(Write("a.mp4", "mp4v"));
  const std::size_t header = bytes.find("tkhd");
  ASSERT_NE(header, std::string::npos);
  const std::string one("\0\1\0\0", 4), minus_one("\xff\xff\0\0", 4), zero(4, '\0');
  bytes.replace(header + 44, 20, zero + one + zero + minus_one + zero);
  io::VideoReader reader(WriteBytes("turned.mp4", bytes));
  io::VideoFrame frame;
  ASSERT_TRUE(reader.Read(10000, &frame));
  ASSERT_EQ(frame.image.width, kHeight);
  ASSERT_EQ(frame.image.height, kWidth);
  double bar = 0;  // the bar of the first frame, brightness 20, was at the top and is now at the right
  for (int y = 0; y < frame.image.height; ++y) bar += frame.image.Pixel(kHeight - 6, y)[0];
  EXPECT_NEAR(bar / frame.image.height, 20, 6);
}

TEST_F(VideoReader, NamesAreNotReadAsPatternsOrProtocols) {
  const std::string bytes = Bytes(Write("a.mp4", "mp4v"));
  for (const char* name : {"a %03d $(touch x).mp4", "concat:b.mp4", "-y", "caf\xe9.mp4"}) {
    EXPECT_EQ(RefusalOf(WriteBytes(name, bytes)), "") << name;
  }
}

TEST_F(VideoReader, ListsOfOtherFilesAreRefused) {
  Write("a.mp4", "mp4v");
  EXPECT_NE(RefusalOf(WriteBytes("list.mp4", "ffconcat version 1.0\nfile a.mp4\n")), "");
  EXPECT_NE(RefusalOf(WriteBytes("hls.mp4",
                                 "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\na.mp4\n#EXT-X-ENDLIST\n")),
            "");
  for (const char* content : {"just text, no frames at all", ""}) {
    const std::string refusal = RefusalOf(WriteBytes("text.mp4", content));
    EXPECT_NE(refusal.find("its content is not a video"), std::string::npos) << refusal;
  }
  EXPECT_NE(RefusalOf(folder_ / "absent.mp4").find("cannot be read"), std::string::npos);
}

TEST_F(VideoReader, HalfCopiedFilesAreNamedOrEndEarly) {
  const std::string mp4 = Bytes(Write("a.mp4", "mp4v"));
  EXPECT_NE(RefusalOf(WriteBytes("cut.mp4", mp4.substr(0, mp4.size() / 2))).find("index"), std::string::npos);
  const std::string avi = Bytes(Write("a.avi", "MJPG"));
  io::VideoReader reader(WriteBytes("cut.avi", avi.substr(0, avi.size() / 2)));
  EXPECT_EQ(reader.info().container_frames, kFrames);
  int n = 0;
  while (reader.Skip()) ++n;
  EXPECT_GT(n, 0);
  EXPECT_LT(n, kFrames);
}

// Needs the program, for OpenCV writes none of these.
fs::path MakeWithFfmpeg(const fs::path& path, std::vector<std::string> arguments) {
  arguments.insert(
      arguments.begin(),
      {io::FindProgram("ffmpeg").value().string(), "-nostdin", "-loglevel", "error", "-f", "lavfi"});
  arguments.push_back(path.string());
  EXPECT_TRUE(io::RunProcess(arguments, {.timeout_s = 60}).Ok());
  return path;
}

TEST_F(VideoReader, SoundAloneIsNoVideo) {
  REQUIRE_PROGRAM("ffmpeg");
  EXPECT_NE(RefusalOf(MakeWithFfmpeg(folder_ / "sound.mp4", {"-i", "sine=duration=0.2", "-c:a", "aac"})), "");
}

TEST_F(VideoReader, TimesOfAVariableFrameRateAreThoseOfTheFile) {
  REQUIRE_PROGRAM("ffmpeg");
  // Ten frames, the second half of which follow three times as slowly.
  io::VideoReader reader(MakeWithFfmpeg(folder_ / "variable.mp4",
                                        {"-i",
                                         "testsrc=rate=25:size=160x120",
                                         "-frames:v",
                                         "10",
                                         "-vf",
                                         "setpts='(N+2*max(0,N-5))/25/TB'",
                                         "-vsync",
                                         "vfr",
                                         "-c:v",
                                         "mpeg4"}));
  io::VideoFrame frame;
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(reader.Read(10000, &frame));
    EXPECT_NEAR(frame.time_s, (i + 2 * std::max(0, i - 5)) / 25.0, 0.011);
  }
}

TEST_F(VideoReader, TenBitsAreReducedAndSaid) {
  REQUIRE_PROGRAM("ffmpeg");
  io::VideoReader reader(MakeWithFfmpeg(
      folder_ / "deep.mkv",
      {"-i", "color=c=0x804020:size=160x120", "-frames:v", "2", "-c:v", "ffv1", "-pix_fmt", "yuv444p10le"}));
  ASSERT_EQ(reader.info().notes.size(), 1u);
  EXPECT_NE(reader.info().notes[0].find("10 bits per channel"), std::string::npos);
  io::VideoFrame frame;
  ASSERT_TRUE(reader.Read(10000, &frame));
  EXPECT_NEAR(frame.image.Pixel(80, 60)[0], 0x80, 4);
  EXPECT_NEAR(frame.image.Pixel(80, 60)[2], 0x20, 4);
}

TEST_F(VideoReader, OfInterlacedFramesOneFieldIsShown) {
  REQUIRE_PROGRAM("ffmpeg");
  // Dark and bright fields by turns: rows of a frame are from both.
  io::VideoReader reader(
      MakeWithFfmpeg(folder_ / "camcorder.mp4",
                     {"-i",
                      "color=size=160x120:rate=50,format=yuv420p,geq=lum='if(mod(N,2),235,16)':cb=128:cr=128,"
                      "tinterlace=interleave_top,setfield=tff",
                      "-frames:v",
                      "3",
                      "-c:v",
                      "libx264",
                      "-flags",
                      "+ilme+ildct",
                      "-qp",
                      "0"}));
  ASSERT_EQ(reader.info().notes.size(), 1u);
  EXPECT_NE(reader.info().notes[0].find("interlaced"), std::string::npos);
  for (const int side : {160, 80}) {
    io::VideoFrame frame;
    ASSERT_TRUE(reader.Read(side, &frame));
    ASSERT_EQ(frame.image.width, side);
    ASSERT_EQ(frame.image.height, side * 3 / 4);
    for (int y = 0; y < frame.image.height; ++y) EXPECT_LE(frame.image.Pixel(side / 2, y)[1], 2) << y;
  }
}

TEST_F(VideoReader, PixelsBecomeSquare) {
  REQUIRE_PROGRAM("ffmpeg");
  io::VideoReader reader(
      MakeWithFfmpeg(folder_ / "hdv.mkv",
                     {"-i", "testsrc=size=144x108", "-frames:v", "2", "-c:v", "ffv1", "-vf", "setsar=4/3"}));
  ASSERT_EQ(reader.info().notes.size(), 1u);
  EXPECT_NE(reader.info().notes[0].find("1.33 times as wide as high"), std::string::npos);
  io::VideoFrame frame;
  ASSERT_TRUE(reader.Read(10000, &frame));
  EXPECT_EQ(frame.image.width, 192);
  EXPECT_EQ(frame.image.height, 108);
  ASSERT_TRUE(reader.Read(96, &frame));
  EXPECT_EQ(frame.image.width, 96);
  EXPECT_EQ(frame.image.height, 54);
}

TEST_F(VideoReader, CameraMotionMeasuresThePathInWidths) {
  io::VideoReader reader(Write("a.avi", "MJPG"));
  io::CameraMotion motion;
  io::VideoFrame frame;
  double path = 0;
  while (reader.Read(10000, &frame)) path = motion.Advance(frame.image);
  const double truth = static_cast<double>(kStep) * (kFrames - 1) / kWidth;
  EXPECT_NEAR(path, truth, 0.05 * truth);
}

TEST_F(VideoReader, CameraMotionIgnoresNoiseAndCountsCuts) {
  io::CameraMotion still;
  io::Image image = io::MakeImage(kWidth, kHeight, 3);
  cv::Mat target(kHeight, kWidth, CV_8UC3, image.data.data()), noise(kHeight, kWidth, CV_8SC3);
  double path = 0;
  for (int i = 0; i < 10; ++i) {
    cv::randn(noise, 0, 3);
    cv::add(texture_(cv::Rect(0, 0, kWidth, kHeight)), noise, target, cv::noArray(), CV_8U);
    path = still.Advance(image);
  }
  EXPECT_LT(path, 0.002);
  texture_(cv::Rect(2 * kWidth, 0, kWidth, kHeight)).copyTo(target);
  EXPECT_GT(still.Advance(image), 0.02);
}

}  // namespace
