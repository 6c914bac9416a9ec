// A whole capture on disk: names, tags, truth, film, and refusals.
#include "samples/capture.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <opencv2/videoio.hpp>
#include <set>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/image/image.h"
#include "io/image/photo_tags.h"
#include "io/process/process.h"
#include "io/scene/transforms.h"
#include "samples/photograph.h"
#include "tests/support/programs/require_program.h"

namespace {

namespace fs = std::filesystem;

class Capture : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("samples_capture_" + std::to_string(getpid()));
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  samples::CaptureOptions Small(const std::string& name) const {
    samples::CaptureOptions options;
    options.out = root_ / name;
    options.width = 96;
    options.photos = 3;
    options.test_views = 2;
    options.threads = 2;
    return options;
  }

  fs::path root_;
};

double Correlation(const io::Image& a, const io::Image& b) {
  const auto n = static_cast<double>(a.data.size());
  double sum_a = 0, sum_b = 0, sum_aa = 0, sum_bb = 0, sum_ab = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    const double x = a.data[i], y = b.data[i];
    sum_a += x, sum_b += y, sum_aa += x * x, sum_bb += y * y, sum_ab += x * y;
  }
  return (n * sum_ab - sum_a * sum_b) /
         std::sqrt((n * sum_aa - sum_a * sum_a) * (n * sum_bb - sum_b * sum_b));
}

TEST_F(Capture, PhotosCarryTagsAndTheTruthReadsBack) {
  samples::CaptureOptions options = Small("photos");
  options.depth = true;
  EXPECT_EQ(samples::WriteCapture(options).pictures, 3);

  const std::string jpeg = io::ReadFile(options.out / "photos/IMG_0003.jpg");
  const io::PhotoTags tags = io::ReadPhotoTags(jpeg);
  EXPECT_FALSE(tags.model.empty());
  const io::Camera camera = samples::CaptureCamera(options);
  // EXIF keeps whole millimetres: half of one in 29 is 1.7 %.
  EXPECT_NEAR(
      io::FocalPixels(tags, camera.width, camera.height).value_or(0), camera.fl_x, 0.018 * camera.fl_x);

  const io::TransformsFile truth = io::ReadTransforms(options.out / "truth/transforms.json");
  EXPECT_TRUE(truth.missing_images.empty());
  ASSERT_EQ(truth.scene.frames.size(), 3u);
  EXPECT_EQ(truth.scene.cameras[0].k1, options.k1);
  EXPECT_EQ(truth.scene.frames[2].image_path.filename(), "IMG_0003.jpg");
  const io::TransformsFile test = io::ReadTransforms(options.out / "truth/transforms_test.json");
  ASSERT_EQ(test.scene.frames.size(), 2u);
  EXPECT_FALSE(test.scene.cameras[0].HasDistortion());
  EXPECT_EQ(io::ReadImage(options.out / "truth/test/002.png").height, 72);

  // The truth is the truth: the scene seen from the written poses through the written lens is what was
  // photographed.
  const samples::StillLife scene({.seed = options.seed, .detail = options.width / 960.0, .threads = 2});
  const auto retaken = [&](const io::TransformsFile& file, std::size_t frame) {
    const samples::Photographer photographer(file.scene.cameras[0], options.photo_samples, 2);
    return photographer.Take(scene, {file.scene.frames[frame].world_from_cam}, {});
  };
  EXPECT_EQ(retaken(test, 1).data, io::ReadImage(options.out / "truth/test/002.png").data);
  const io::Image photo = io::ReadImage(options.out / "photos/IMG_0003.jpg");
  EXPECT_GT(Correlation(retaken(truth, 2), photo), 0.97);
  EXPECT_LT(Correlation(retaken(truth, 1), photo), 0.8);

  const std::string depth = io::ReadFile(options.out / "truth/depth/IMG_0001.pfm");
  EXPECT_EQ(depth.substr(0, 3), "Pf\n");
  EXPECT_GT(depth.size(), 96u * 72u * sizeof(float));
}

TEST_F(Capture, SameOptionsGiveTheSameBytes) {
  samples::CaptureOptions options = Small("a");
  options.test_views = 0;
  samples::WriteCapture(options);
  options.out = root_ / "b";
  options.threads = 1;
  samples::WriteCapture(options);
  for (const char* name : {"photos/IMG_0001.jpg", "photos/IMG_0003.jpg", "truth/transforms.json"}) {
    EXPECT_EQ(io::ReadFile(root_ / "a" / name), io::ReadFile(root_ / "b" / name)) << name;
  }
}

// Mean absolute difference of horizontal neighbours: falls when a frame is blurred.
double Sharpness(const cv::Mat& frame) {
  double sum = 0;
  for (int y = 0; y < frame.rows; ++y) {
    for (int x = 3; x < 3 * frame.cols; ++x) sum += std::abs(frame.ptr(y)[x] - frame.ptr(y)[x - 3]);
  }
  return sum;
}

TEST_F(Capture, FilmHasItsLengthAndItsBlurredFramesAreTheBlurredOnes) {
  REQUIRE_PROGRAM("ffmpeg");
  samples::CaptureOptions options = Small("film");
  options.kind = samples::CaptureKind::kVideo;
  options.width = 192;
  options.video_s = 1;
  options.video_blurs = 1;
  options.test_views = 0;
  options.blur_angle = 0.12;
  EXPECT_EQ(samples::WriteCapture(options).pictures, 30);
  EXPECT_NE(io::ReadFile(options.out / "truth/transforms.json").find("\"frame_000029.png\""),
            std::string::npos);
  EXPECT_FALSE(fs::exists(options.out / "frames"));

  std::set<int> blurred;
  std::ifstream names(options.out / "truth/blurred_frames.txt");
  for (std::string name; std::getline(names, name);)
    blurred.insert(std::stoi(name.substr(name.find('_') + 1)));
  EXPECT_EQ(blurred.size(), 3u);
  cv::VideoCapture film((options.out / "walkaround.mp4").string());
  double sharpest_blurred = 0, softest_sharp = 1e18;
  int frames = 0;
  for (cv::Mat frame; film.read(frame); ++frames) {
    double& extreme = blurred.count(frames) ? sharpest_blurred : softest_sharp;
    extreme =
        blurred.count(frames) ? std::max(extreme, Sharpness(frame)) : std::min(extreme, Sharpness(frame));
  }
  EXPECT_EQ(frames, 30);
  EXPECT_LT(sharpest_blurred, 0.85 * softest_sharp);
}

TEST_F(Capture, RefusesToOverwriteAndImpossibleSizes) {
  samples::CaptureOptions options = Small("taken");
  io::WriteFileAtomically(options.out / "precious.txt", "mine");
  const auto code = [](const samples::CaptureOptions& o) {
    try {
      samples::WriteCapture(o);
    } catch (const io::Error& error) {
      return error.code();
    }
    return io::ExitCode::kOk;
  };
  EXPECT_EQ(code(options), io::ExitCode::kUsage);
  EXPECT_EQ(io::ReadFile(options.out / "precious.txt"), "mine");
  options = Small("odd");
  options.width = 97;
  EXPECT_EQ(code(options), io::ExitCode::kUsage);
  options = Small("none");
  options.photos = 0;
  EXPECT_EQ(code(options), io::ExitCode::kUsage);
  EXPECT_THROW(samples::ParseCaptureKind("movie"), io::Error);
}

}  // namespace
