// Films: the product decodes to the frames that went in, and failures keep the frames.
#include "io/video/video_writer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/image/image.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/require_program.h"

namespace {

namespace fs = std::filesystem;

class VideoWriter : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("video writer's 50%d " + std::to_string(getpid()));
    fs::create_directories(folder_ / "frames");
  }
  void TearDown() override { fs::remove_all(folder_); }

  // A red square on grey that moves right; blue grows with time.
  void WriteFrames(int n, int width, int height) {
    for (int i = 0; i < n; ++i) {
      io::Image frame = io::MakeImage(width, height, 3);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          const bool inside = std::abs(x - 10 - 4 * i) < 8 && std::abs(y - height / 2) < 8;
          frame.Pixel(x, y)[0] = inside ? 220 : 90;
          frame.Pixel(x, y)[1] = inside ? 30 : 90;
          frame.Pixel(x, y)[2] = static_cast<std::uint8_t>(inside ? 30 : 90 + 5 * i);
        }
      }
      io::WriteImage(folder_ / "frames" / io::VideoFrameName(i), frame);
    }
  }

  fs::path folder_;
};

TEST_F(VideoWriter, FilmDecodesToItsFrames) {
  WriteFrames(12, 128, 96);
  const io::VideoEncoder encoder = io::ProbeVideoEncoder(128, 96, folder_);
  EXPECT_FALSE(encoder.decision.empty());
  const fs::path mp4 = folder_ / "a: film.mp4";
  const io::VideoReport report = io::EncodeVideo(encoder, folder_ / "frames", 12, 24, mp4);
  EXPECT_EQ(report.frames, 12);
  EXPECT_EQ(report.bytes, fs::file_size(mp4));

  cv::VideoCapture capture(mp4.string());
  ASSERT_TRUE(capture.isOpened());
  EXPECT_NEAR(capture.get(cv::CAP_PROP_FPS), 24, 1e-6);
  cv::Mat bgr;
  for (int i = 0; i < 12; ++i) {
    ASSERT_TRUE(capture.read(bgr)) << i;
    const cv::Vec3b centre = bgr.at<cv::Vec3b>(48, 10 + 4 * i), corner = bgr.at<cv::Vec3b>(5, 5);
    EXPECT_NEAR(centre[2], 220, 10) << i;  // red where the square is
    EXPECT_NEAR(centre[0], 30, 10) << i;
    EXPECT_NEAR(corner[0], 90 + 5 * i, 8) << i;
  }
  EXPECT_FALSE(capture.read(bgr));
}

TEST_F(VideoWriter, IndexStandsInFrontOfTheData) {
  WriteFrames(3, 64, 64);
  const fs::path mp4 = folder_ / "film.mp4";
  io::EncodeVideo(io::ProbeVideoEncoder(64, 64, folder_), folder_ / "frames", 3, 30, mp4);
  const std::string bytes = io::ReadFile(mp4);
  EXPECT_LT(bytes.find("moov"), bytes.find("mdat"));
}

TEST_F(VideoWriter, ProbeLeavesNothingBehind) {
  io::ProbeVideoEncoder(64, 48, folder_);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);  // frames/
}

TEST_F(VideoWriter, MissingFrameFailsAndKeepsTheOthers) {
  WriteFrames(5, 64, 64);
  fs::remove(folder_ / "frames" / io::VideoFrameName(2));
  const fs::path mp4 = folder_ / "film.mp4";
  const io::VideoEncoder encoder = io::ProbeVideoEncoder(64, 64, folder_);
  try {
    io::EncodeVideo(encoder, folder_ / "frames", 5, 30, mp4);
    FAIL() << "a film of 5 frames cannot come from 4";
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kMissingTool);
    EXPECT_NE(std::string(error.what()).find("frames"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(fs::exists(mp4));
  EXPECT_TRUE(fs::exists(folder_ / "frames" / io::VideoFrameName(4)));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(VideoWriter, UnknownCodecFailsWithTheEncodersWords) {
  WriteFrames(2, 64, 64);
  io::VideoEncoder encoder = io::ProbeVideoEncoder(64, 64, folder_);
  encoder.codec = "no_such_codec";
  try {
    io::EncodeVideo(encoder, folder_ / "frames", 2, 30, folder_ / "film.mp4");
    FAIL();
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kMissingTool);
    EXPECT_NE(std::string(error.what()).find("no_such_codec"), std::string::npos) << error.what();
  }
}

// Stand-ins for ffmpeg, first on PATH.
class FakeEncoder : public VideoWriter {
 protected:
  void Install(const std::string& script) {
    const fs::path program = folder_ / "bin" / "ffmpeg";
    fs::create_directories(program.parent_path());
    std::ofstream(program) << "#!/bin/sh\n" << script;
    fs::permissions(program, fs::perms::owner_all);
    old_path_ = std::getenv("PATH");
    setenv("PATH", program.parent_path().c_str(), 1);
  }
  void TearDown() override {
    setenv("PATH", old_path_.c_str(), 1);
    VideoWriter::TearDown();
  }
  std::string old_path_;
};

TEST_F(FakeEncoder, SuccessWithoutAFilmIsNotBelieved) {
  Install("exit 0\n");
  try {
    io::ProbeVideoEncoder(64, 64, folder_);
    FAIL();
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kMissingTool);
  }
}

TEST_F(FakeEncoder, AMissingProgramIsNamedWithItsPackage) {
  Install("");
  fs::remove(folder_ / "bin" / "ffmpeg");
  EXPECT_ERROR(io::ProbeVideoEncoder(64, 64, folder_),
               io::ExitCode::kMissingTool,
               "ffmpeg is not on PATH",
               "apt-get install ffmpeg");
}

TEST_F(FakeEncoder, WithoutH264AnotherCodecIsChosenAndSaid) {
  Install(
      "case \"$*\" in *libx264*) echo unknown encoder libx264 >&2; exit 1;; esac\n"
      "exec /usr/bin/ffmpeg \"$@\"\n");
  REQUIRE_PROGRAM("ffmpeg");
  const io::VideoEncoder encoder = io::ProbeVideoEncoder(64, 64, folder_);
  EXPECT_NE(encoder.codec, "libx264");
  EXPECT_NE(encoder.decision.find("unknown encoder libx264"), std::string::npos) << encoder.decision;
}

}  // namespace
