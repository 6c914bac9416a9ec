// The film: right number of frames, resumed where it stopped, frames kept when the encoder fails.
#include "pipeline/film/film.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/image/image.h"
#include "io/scene/transforms.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/film/camera_path_file.h"
#include "pipeline/film/support_pictures.h"
#include "tests/support/programs/require_program.h"
#include "tests/support/scenes/sphere_field.h"

namespace {

namespace fs = std::filesystem;
using tests::SphereField;

class FilmTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("film test " + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    scene_ = tests::RingScene(10, 81, 61, [](int) { return "unused.png"; });
    options_.frames = 6;
  }
  void TearDown() override { fs::remove_all(folder_); }

  static int CountFrames(const fs::path& mp4) {
    cv::VideoCapture capture(mp4.string());
    int n = 0;
    for (cv::Mat frame; capture.read(frame);) ++n;
    return n;
  }

  fs::path folder_;
  io::Scene scene_;
  pipeline::FilmOptions options_;
};

TEST_F(FilmTest, FilmAndDepthHaveAllFramesAndEvenSize) {
  options_.depth = true;
  const pipeline::Film film = pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
  EXPECT_EQ(film.rendered, 6);
  EXPECT_EQ(film.size.camera.width, 82);
  EXPECT_EQ(film.size.camera.height % 2, 0);
  EXPECT_EQ(CountFrames(folder_ / "novel_view.mp4"), 6);
  EXPECT_EQ(CountFrames(folder_ / "depth.mp4"), 6);
  EXPECT_EQ(film.videos.size(), 2u);
  EXPECT_GT(film.videos[0].cpu_s, 0);
  const io::Image depth = io::ReadImage(folder_ / "depth_frames" / "000001.png");
  EXPECT_EQ(depth.Pixel(0, 0)[0] + depth.Pixel(0, 0)[1] + depth.Pixel(0, 0)[2], 0);  // the ray left the scene
  const std::uint8_t* centre = depth.Pixel(depth.width / 2, depth.height / 2);
  EXPECT_GT(centre[2], centre[0]);  // 3 units away in [2, 6]: the blue end
}

TEST_F(FilmTest, HowEvenThePathIsIsSaidAndAFaultOfAFrameNamed) {
  options_.frames = 24;
  const auto says = [&](const char* text) {
    const pipeline::Film film = pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
    return std::any_of(film.decisions.begin(), film.decisions.end(), [&](const std::string& line) {
      return line.find(text) != std::string::npos;
    });
  };
  EXPECT_TRUE(says("even path: the largest step"));
  EXPECT_FALSE(says("warning"));
  // Frames that are kept are looked at too.
  const fs::path frame = folder_ / "frames" / "000012.png";
  io::Image veiled = io::ReadImage(frame);
  std::fill(veiled.data.begin(), veiled.data.end(), 22);
  io::WriteImage(frame, veiled);
  EXPECT_TRUE(says("warning: unlike the frames before and after it: frame 12"));
}

TEST_F(FilmTest, RaysPerPixelReachTheField) {
  options_.pixel_rays = 9;
  const SphereField field;
  pipeline::RenderFilm(field, scene_, options_, folder_);
  EXPECT_EQ(field.last_options.samples_per_pixel, 9);
}

TEST_F(FilmTest, TheFieldIsHalfAsFineAsTheTrainingPicturesButForDepths) {
  const double trained = scene_.cameras[0].fl_x;
  const SphereField field;
  pipeline::RenderFilm(field, scene_, options_, folder_);
  EXPECT_EQ(field.last_options.field_focal_px, 0.5 * trained);
  options_.depth = true;
  pipeline::RenderFilm(field, scene_, options_, folder_);
  EXPECT_EQ(field.last_options.field_focal_px, trained);
}

TEST_F(FilmTest, AGivenPathIsFilmedAsItIs) {
  pipeline::CameraPathFile file{.width = 64, .height = 48, .fps = 20};
  for (const double fov : {0.5, 0.7, 0.9}) file.frames.push_back({scene_.frames[3].world_from_cam, fov});
  options_.path = folder_ / "path.json";
  pipeline::WriteCameraPath(options_.path, file);
  const pipeline::Film film = pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
  EXPECT_EQ(film.frames, 3);
  EXPECT_EQ(film.fps, 20);
  EXPECT_EQ(film.size.camera.width, 64);
  EXPECT_EQ(film.size.camera.height, 48);
  EXPECT_EQ(CountFrames(folder_ / "novel_view.mp4"), 3);
  const io::Image last = io::ReadImage(folder_ / "frames/000003.png");
  const nerf::RenderedView expected =
      SphereField().Render(nerf::CameraOfView(64, 48, 0.9), scene_.frames[3].world_from_cam, {});
  EXPECT_EQ(last.data, pipeline::QuantizeView(expected).data);
  const io::Scene written = io::ReadTransforms(folder_ / "camera_path.json").scene;
  ASSERT_EQ(written.frames.size(), 3u);
  EXPECT_NEAR(written.cameras.at(static_cast<std::size_t>(written.frames[2].camera_index)).fl_y,
              24 / std::tan(0.45),
              1e-6);
}

TEST_F(FilmTest, WidthScalesTheCamera) {
  const io::Camera camera = pipeline::FilmCamera(scene_, 41, 0);
  EXPECT_EQ(camera.width, 42);
  EXPECT_NEAR(camera.fl_x, 1.3 * 42, 1e-9);
  EXPECT_NEAR(camera.cx, 21, 1e-9);
}

TEST_F(FilmTest, DefaultIs1280WideWhereThePhotosAllowIt) {
  EXPECT_EQ(pipeline::FilmCamera(scene_, 0, 4000).width, 1280);
  EXPECT_EQ(pipeline::FilmCamera(scene_, 0, 640).width, 640);
  EXPECT_EQ(pipeline::FilmCamera(scene_, 0, 0).width, 82);  // of training, even
  scene_.cameras[0] = io::ResizedCamera(scene_.cameras[0], 60, 120);
  const io::Camera upright = pipeline::FilmCamera(scene_, 0, 4000);
  EXPECT_EQ(upright.height, 1280);
  EXPECT_EQ(upright.width, 640);
}

TEST_F(FilmTest, DefaultLastsSixSecondsAndALongWalkTwelve) {
  nerf::CameraPath path = nerf::FitCameraPath(scene_, 60);
  EXPECT_EQ(pipeline::DefaultFrames(path, 30), 180);
  EXPECT_EQ(pipeline::DefaultFrames(path, 24), 144);
  path.kind = nerf::PathKind::kWalk;
  path.capture.depth = 0.01;
  EXPECT_EQ(pipeline::DefaultFrames(path, 30), 360);
}

TEST_F(FilmTest, ShrinksUntilItFitsTheCeilingButNotBelowTheTrainingPictures) {
  options_.photo_side = 160;
  options_.ceiling_s = 1e-9;
  const pipeline::Film film = pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
  EXPECT_EQ(film.size.camera.width, 82);
  EXPECT_TRUE(std::any_of(film.decisions.begin(), film.decisions.end(), [](const std::string& line) {
    return line.find("instead of 160") != std::string::npos;
  }));
  // Going on, it keeps the size of the frames that are there.
  options_.ceiling_s = 1e9;
  EXPECT_EQ(pipeline::RenderFilm(SphereField(), scene_, options_, folder_).size.camera.width, 82);
}

TEST_F(FilmTest, PosesOfTheFramesAreWritten) {
  const pipeline::Film film = pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
  const io::Scene written = io::ReadTransforms(folder_ / "camera_path.json").scene;
  ASSERT_EQ(written.frames.size(), 6u);
  EXPECT_EQ(written.cameras[0], film.size.camera);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_NEAR(
        (written.frames[i].world_from_cam.translation - film.path.world_from_cam[i].translation).norm(),
        0,
        1e-9);
  }
}

TEST_F(FilmTest, SupportIsBlackWhereNoViewSawTheSurface) {
  options_.support = true;
  // Cameras on one side of the sphere, and a film that looks at it from there too.
  scene_.frames.resize(3);
  pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
  EXPECT_EQ(CountFrames(folder_ / "support.mp4"), 6);
  const std::vector<pipeline::SupportPictures> pictures = pipeline::FindSupportPictures(folder_);
  ASSERT_EQ(pictures.size(), 3u);
  EXPECT_EQ(pictures[0].frame, 1);
  const io::Image views = io::ReadImage(pictures[0].views), angle = io::ReadImage(pictures[0].angle);
  const auto brightness = [](const io::Image& image, int x, int y) {
    const std::uint8_t* pixel = image.Pixel(x, y);
    return pixel[0] + pixel[1] + pixel[2];
  };
  EXPECT_GT(brightness(views, views.width / 2, views.height / 2), 100);
  EXPECT_GT(brightness(angle, views.width / 2, views.height / 2), 100);
}

// Half of the sphere is cut away, and with it what views saw there.
TEST_F(FilmTest, SupportEndsAtTheCropBox) {
  const auto n_coloured = [&] {
    options_.support = true;
    pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
    const io::Image image = io::ReadImage(folder_ / "support_frames" / "000002.png");
    fs::remove_all(folder_ / "frames");
    fs::remove_all(folder_ / "support_frames");
    long n = 0;
    for (std::size_t i = 0; i < image.data.size(); i += 3)
      n += image.data[i] + image.data[i + 1] + image.data[i + 2] > 0;
    return static_cast<double>(n);
  };
  const double whole = n_coloured();
  pipeline::CameraPathFile file{.width = 64, .height = 48, .fps = 20};
  file.frames.push_back({scene_.frames[0].world_from_cam, 0.5});
  file.crop.emplace();
  file.crop->box.world_from_box.translation = {0, 0, 2};
  file.crop->box.size = {4, 4, 4};
  options_.crop = folder_ / "box.json";
  pipeline::WriteCameraPath(options_.crop, file);
  const double upper = n_coloured();
  EXPECT_GT(upper, 0.2 * whole);
  EXPECT_LT(upper, 0.8 * whole);
}

TEST_F(FilmTest, ContinuesAtTheFirstMissingFrame) {
  pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
  const std::string before = io::ReadFile(folder_ / "frames" / "000004.png");
  fs::remove(folder_ / "frames" / "000003.png");
  fs::remove(folder_ / "novel_view.mp4");
  const pipeline::Film film = pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
  EXPECT_EQ(film.rendered, 1);
  EXPECT_EQ(io::ReadFile(folder_ / "frames" / "000004.png"), before);
  EXPECT_EQ(CountFrames(folder_ / "novel_view.mp4"), 6);
}

// Stand-ins for ffmpeg, first on PATH.
class FilmWithoutEncoderTest : public FilmTest {
 protected:
  void SetUp() override {
    FilmTest::SetUp();
    old_path_ = std::getenv("PATH");
  }
  void TearDown() override {
    setenv("PATH", old_path_.c_str(), 1);
    FilmTest::TearDown();
  }
  void Install(const std::string& script) {
    const fs::path program = folder_ / "bin" / "ffmpeg";
    fs::create_directories(program.parent_path());
    std::ofstream(program) << "#!/bin/sh\n" << script;
    fs::permissions(program, fs::perms::owner_all);
    setenv("PATH", program.parent_path().c_str(), 1);
  }
  std::string old_path_;
};

TEST_F(FilmWithoutEncoderTest, NothingIsRenderedWhenNoEncoderWorks) {
  Install("exit 1\n");
  const SphereField field;
  try {
    pipeline::RenderFilm(field, scene_, options_, folder_);
    FAIL();
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kMissingTool);
  }
  EXPECT_EQ(field.n_renders, 0);
}

TEST_F(FilmWithoutEncoderTest, EncoderThatFailsLaterLeavesTheFrames) {
  REQUIRE_PROGRAM("ffmpeg");
  Install("case \"$*\" in *probe*) exec /usr/bin/ffmpeg \"$@\";; esac\necho disk on fire >&2\nexit 1\n");
  try {
    pipeline::RenderFilm(SphereField(), scene_, options_, folder_);
    FAIL();
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kMissingTool);
    EXPECT_NE(std::string(error.what()).find("disk on fire"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("frames"), std::string::npos) << error.what();
  }
  EXPECT_TRUE(fs::exists(folder_ / "frames" / "000006.png"));
  EXPECT_FALSE(fs::exists(folder_ / "novel_view.mp4"));
}

}  // namespace
