// The camera model by need, on synthetic captures whose camera is known.
#include "sfm/bundle/camera_model_selection.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "sfm/scene/undistort.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/pose_difference.h"
#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

using Eigen::Vector3d;

constexpr double kNoisePx = 0.5;

struct Result {
  io::ColmapModel model;
  sfm::SelectedCameraModel selected;
  std::string lines;

  const io::Camera& camera() const { return model.scene.cameras[0]; }
  double Sigma(sfm::Intrinsic i) const { return selected.uncertainty.intrinsics[0][i]; }
};

Result Select(io::ColmapModel model, const sfm::CameraModelOptions& options = {}) {
  Result result;
  result.selected = sfm::AdjustWithSelectedCameraModel(
      &model, options, [&](const std::string& line) { result.lines += line + "\n"; });
  result.model = std::move(model);
  return result;
}

// A ring seen through `truth`; the adjustment starts with `start`.
io::ColmapModel Capture(const io::Camera& truth,
                        const io::Camera& start,
                        std::uint64_t seed,
                        int points = 150) {
  io::ColmapModel model = RingModel(14, points, truth, kNoisePx, seed);
  model.scene.cameras = {start};
  return model;
}

// What COLMAP leaves behind when it fits too rich a camera to noise.
TEST(CameraModelSelection, PinholeDataStayPinhole) {
  io::Camera fitted = SmallCamera();
  fitted.fl_y = 500.4, fitted.k1 = 0.002, fitted.k2 = -0.003, fitted.p1 = 2e-4, fitted.p2 = -1e-4;
  int stayed = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const Result result = Select(Capture(SmallCamera(), fitted, seed, 80), {.seed = seed});
    stayed += result.selected.camera_model == "SIMPLE_PINHOLE" && !result.selected.free[0].principal_point;
    EXPECT_NEAR(result.camera().fl_x, 500, 5 * result.Sigma(sfm::kFocal));
  }
  EXPECT_GE(stayed, 38);  // 95 %
}

TEST(CameraModelSelection, EachModelIsFoundWhereItIsNeeded) {
  io::Camera radial1 = SmallCamera(), radial2, opencv;
  radial1.k1 = -0.05;
  radial2 = radial1;
  radial2.k1 = -0.15, radial2.k2 = 0.25;
  opencv = radial2;
  opencv.fl_y = 515, opencv.p1 = 0.008, opencv.p2 = -0.009;
  const std::pair<std::string, io::Camera> cases[] = {
      {"SIMPLE_RADIAL", radial1}, {"RADIAL", radial2}, {"OPENCV", opencv}};
  for (const auto& [name, truth] : cases) {
    const Result result = Select(Capture(truth, SmallCamera(), 1));
    EXPECT_EQ(result.selected.camera_model, name) << result.lines;
    EXPECT_EQ(result.model.camera_model, name);
    EXPECT_FALSE(result.selected.free[0].principal_point) << result.lines;
    const sfm::IntrinsicVector error = sfm::ToVector(result.camera()) - sfm::ToVector(truth);
    for (const int i : sfm::FreeIndices(result.selected.free[0])) {
      EXPECT_LT(std::abs(error[i]), 4 * result.selected.uncertainty.intrinsics[0][i]) << name << " " << i;
    }
    EXPECT_NE(result.lines.find(name + " ("), std::string::npos) << result.lines;
  }
  EXPECT_EQ(std::size(cases), 3u);
}

// The observations lie in the middle of the picture and agree with a distortion that turns back farther out.
TEST(CameraModelSelection, ADistortionThatFoldsThePictureIsNotTaken) {
  io::Camera truth = SmallCamera();
  truth.width *= 3, truth.height *= 3, truth.cx *= 3, truth.cy *= 3;
  io::Camera start = truth;
  truth.k1 = -0.4;
  ASSERT_FALSE(sfm::HasRaysAtBorder(truth));
  const Result result = Select(Capture(truth, start, 1));
  EXPECT_TRUE(sfm::HasRaysAtBorder(result.camera())) << result.lines;
  EXPECT_NE(result.lines.find("SIMPLE_RADIAL (k1) is not needed"), std::string::npos) << result.lines;
}

// k1 alone lowers the error by 0.3 % here, as it did for the lens of a phone.
TEST(CameraModelSelection, TermsThatOpposeEachOtherAreFoundTogether) {
  io::Camera wavy = SmallCamera();
  wavy.k1 = 0.05, wavy.k2 = -0.12;
  const Result result = Select(Capture(wavy, SmallCamera(), 9));
  EXPECT_NE(result.lines.find("RADIAL (k1, k2) is needed"), std::string::npos) << result.lines;
  EXPECT_EQ(result.selected.camera_model, "RADIAL") << result.lines;
  EXPECT_EQ(result.model.scene.cameras.size(), 1u) << result.lines;  // focal lengths do not stand in for k2
  EXPECT_NEAR(result.camera().k2, -0.12, 4 * result.Sigma(sfm::kK2));
}

TEST(CameraModelSelection, PrincipalPointIsFoundWhenItIsOffAndKeptWhenItIsGiven) {
  io::Camera off = SmallCamera();
  off.cx += 64, off.cy -= 20;
  const Result found = Select(Capture(off, SmallCamera(), 2));
  EXPECT_TRUE(found.selected.free[0].principal_point) << found.lines;
  EXPECT_EQ(found.selected.camera_model, "SIMPLE_PINHOLE") << found.lines;
  EXPECT_NEAR(found.camera().cx, off.cx, 4 * found.Sigma(sfm::kCx));
  EXPECT_NEAR(found.camera().cy, off.cy, 4 * found.Sigma(sfm::kCy));

  off.cx = 0.7 * off.width;  // 20 % of the width
  const Result kept = Select(Capture(off, off, 3));
  EXPECT_FALSE(kept.selected.free[0].principal_point) << kept.lines;
  EXPECT_EQ(kept.camera().cx, off.cx);
  EXPECT_EQ(kept.camera().cy, off.cy);
}

// Parallel cameras on a line (depths and focal length scale together: affine ambiguity) or above flat ground.
io::ColmapModel ParallelCameras(int columns, int rows, double depth, double relief, const io::Camera& truth) {
  io::ColmapModel model;
  model.scene.cameras = {truth};
  for (int i = 0; i < columns * rows; ++i) {
    const Vector3d centre(0.5 * (i % columns), 0.7 * (i / columns), depth);
    const io::Rigid3d pose = LookAt(centre, centre - Vector3d::UnitZ(), Vector3d::UnitY());
    model.scene.frames.push_back({"nadir " + std::to_string(i) + ".png", 0, pose});
  }
  std::mt19937_64 random(4);
  const double width = 0.5 * (columns - 1), height = 0.7 * (rows - 1);
  for (int i = 0; i < 400; ++i) {
    const double u = 2 * Uniform(&random) - 0.5, v = 2 * Uniform(&random) - 0.5;
    const Vector3d xyz(u * (width + 1), v * (height + 1), relief * (Uniform(&random) - 0.5));
    AddPoint(&model, xyz, kNoisePx, &random);
  }
  return model;
}

TEST(CameraModelSelection, FocalLengthThatThePicturesDoNotTellIsKept) {
  io::ColmapModel line = ParallelCameras(10, 1, 2, 1.5, SmallCamera());
  line.scene.cameras[0].fl_x = line.scene.cameras[0].fl_y = 520;
  const Result result = Select(line, {.known_focal_px = {500}});
  EXPECT_FALSE(result.selected.free[0].focal) << result.lines;
  EXPECT_EQ(result.camera().fl_x, 500);
  EXPECT_EQ(result.camera().fl_y, 500);
  EXPECT_NE(result.lines.find("held at 500 px (known)"), std::string::npos) << result.lines;
  const Result guess = Select(line);
  EXPECT_EQ(guess.camera().fl_x, 520);
  EXPECT_NE(guess.lines.find("held at 520 px (a guess)"), std::string::npos) << guess.lines;
}

// Over a plane seen straight down, a ground bent into a bowl could stand for k1; relief of 2.5 % tells them
// apart.
TEST(CameraModelSelection, NadirGridFindsItsDistortionAndHoldsTheRest) {
  io::Camera truth = SmallCamera();
  truth.k1 = -0.05;
  io::ColmapModel grid = ParallelCameras(5, 4, 2, 0.05, truth);
  grid.scene.cameras = {SmallCamera()};
  const Result result = Select(grid);
  const sfm::FreeIntrinsics& free = result.selected.free[0];
  EXPECT_FALSE(free.focal) << result.lines;
  EXPECT_FALSE(free.principal_point) << result.lines;
  EXPECT_TRUE(free.k1) << result.lines;
  EXPECT_NEAR(result.camera().k1, -0.05, 4 * result.Sigma(sfm::kK1)) << result.lines;
}

TEST(CameraModelSelection, EachCameraIsDecidedForItself) {
  io::Camera distorted = SmallCamera();
  distorted.k1 = -0.1;
  io::ColmapModel model = Ring(15, SmallCamera());
  model.scene.cameras = {SmallCamera(), distorted, distorted};
  for (std::size_t i = 0; i < 15; ++i) model.scene.frames[i].camera_index = i == 14 ? 2 : i % 2 == 0;
  std::mt19937_64 random(6);
  for (int i = 0; i < 190; ++i) AddPoint(&model, RandomVector(&random, 1.2), kNoisePx, &random);
  model.scene.cameras[1].k1 = 0;
  model.scene.cameras[2].k1 = 0;  // sees fewer than 200 points
  const Result result = Select(model);
  EXPECT_EQ(result.selected.camera_model, "SIMPLE_RADIAL") << result.lines;
  EXPECT_FALSE(result.selected.free[0].k1) << result.lines;
  EXPECT_TRUE(result.selected.free[1].k1) << result.lines;
  EXPECT_FALSE(result.selected.free[2].k1) << result.lines;
  EXPECT_NEAR(
      result.model.scene.cameras[1].k1, -0.1, 4 * result.selected.uncertainty.intrinsics[1][sfm::kK1]);
  EXPECT_EQ(result.model.scene.cameras[0].k1, 0);
}

// Found where pictures were focused one by one, with the lens they share; not found where they were not.
TEST(CameraModelSelection, PicturesGetFocalLengthsOfTheirOwnWhereTheyDiffer) {
  const io::ColmapModel truth = OwnFocals(14, 150, kNoisePx, 8);
  io::ColmapModel shared = truth;
  shared.scene.cameras = {SmallCamera()};
  for (io::Frame& frame : shared.scene.frames) frame.camera_index = 0;
  const Result result = Select(shared);
  ASSERT_EQ(result.model.scene.cameras.size(), 14u) << result.lines;
  for (std::size_t i = 0; i < 14; ++i) {
    EXPECT_EQ(result.model.scene.frames[i].camera_index, static_cast<int>(i));
    EXPECT_TRUE(result.selected.free[i].focal);
    const double error = result.model.scene.cameras[i].fl_x - truth.scene.cameras[i].fl_x;
    EXPECT_LT(std::abs(error), 5 * result.selected.uncertainty.intrinsics[i][sfm::kFocal]) << i;
    EXPECT_EQ(result.model.scene.cameras[i].cx, result.model.scene.cameras[0].cx);
    EXPECT_EQ(result.model.scene.cameras[i].k1, result.model.scene.cameras[0].k1);
  }
  EXPECT_LT(Compare(result.model.scene, truth.scene).rotation_deg, 0.15) << result.lines;
  EXPECT_EQ(Select(shared, {.camera_model = "SIMPLE_RADIAL"}).model.scene.cameras.size(), 1u);

  int stayed = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    stayed += Select(Capture(DistortedCamera(), SmallCamera(), seed)).model.scene.cameras.size() == 1;
  }
  EXPECT_GE(stayed, 19);  // 95 %
}

// Every other picture is taken with a longer lens; `zoom` is how far focusing changes the focal lengths.
io::ColmapModel TwoLenses(double zoom) {
  io::Camera wide = SmallCamera(), tele = SmallCamera();
  wide.k1 = -0.05;
  tele.fl_x = tele.fl_y = 700, tele.cx = 330, tele.k1 = 0.1;
  io::ColmapModel model = Ring(16, wide);
  model.scene.cameras.clear();
  std::mt19937_64 random(9);
  for (std::size_t i = 0; i < 16; ++i) {
    io::Camera camera = i % 2 == 0 ? wide : tele;
    camera.fl_x = camera.fl_y = camera.fl_x * (1 + zoom * (2 * Uniform(&random) - 1));
    model.scene.frames[i].camera_index = static_cast<int>(i);
    model.scene.cameras.push_back(camera);
  }
  for (int i = 0; i < 200; ++i) AddPoint(&model, RandomVector(&random, 1), kNoisePx, &random);
  return model;
}

TEST(CameraModelSelection, PicturesWithFocalLengthsOfTheirOwnKeepTheirLens) {
  for (const double zoom : {0.03, 0.0}) {
    const io::ColmapModel truth = TwoLenses(zoom);
    io::ColmapModel shared = truth;
    shared.scene.cameras = {SmallCamera(), SmallCamera()};
    shared.scene.cameras[1].fl_x = shared.scene.cameras[1].fl_y = 700, shared.scene.cameras[1].cx = 330;
    for (std::size_t i = 0; i < 16; ++i) shared.scene.frames[i].camera_index = i % 2;
    const Result result = Select(shared);
    const auto& cameras = result.model.scene.cameras;
    if (zoom == 0) {
      EXPECT_EQ(cameras.size(), 2u) << result.lines;
      const std::string before = " px, ", line = result.lines.substr(result.lines.find("focal length per"));
      EXPECT_LT(std::stod(line.substr(line.find(before) + before.size())), 3) << line;
      continue;
    }
    ASSERT_EQ(cameras.size(), 16u) << result.lines;
    for (std::size_t i = 0; i < 16; ++i) {
      const sfm::IntrinsicVector& sigma = result.selected.uncertainty.intrinsics[i];
      EXPECT_NEAR(cameras[i].fl_x, truth.scene.cameras[i].fl_x, 5 * sigma[sfm::kFocal]) << i;
      EXPECT_NEAR(cameras[i].k1, truth.scene.cameras[i].k1, 5 * sigma[sfm::kK1]) << i;
      EXPECT_EQ(cameras[i].k1, cameras[i % 2].k1) << i;
      EXPECT_EQ(cameras[i].cx, truth.scene.cameras[i].cx) << i;
    }
  }
}

TEST(CameraModelSelection, AGivenModelIsUsedAndAnUnknownOneRefused) {
  io::Camera start = SmallCamera();
  start.k1 = 0.01, start.p1 = 1e-3;
  const Result radial = Select(Capture(SmallCamera(), start, 5), {.camera_model = "RADIAL"});
  EXPECT_EQ(radial.selected.camera_model, "RADIAL");
  EXPECT_TRUE(radial.selected.free[0].k2);
  EXPECT_EQ(radial.camera().p1, 0);
  const Result pinhole = Select(Capture(SmallCamera(), start, 5), {.camera_model = "PINHOLE"});
  EXPECT_NE(pinhole.camera().fl_x, pinhole.camera().fl_y);
  EXPECT_EQ(pinhole.camera().k1, 0);
  io::ColmapModel model = Capture(SmallCamera(), start, 5);
  EXPECT_ERROR(
      sfm::AdjustWithSelectedCameraModel(&model, {.camera_model = "FISHEYE"}, [](const std::string&) {}),
      io::ExitCode::kUsage,
      "'FISHEYE' is not supported");
}

TEST(CameraModelSelection, WithoutObservationsToHoldOutTheModelStays) {
  io::Camera truth = SmallCamera();
  truth.k1 = -0.05;
  io::ColmapModel model = RingModel(3, 200, truth, kNoisePx, 7);
  model.camera_model = "SIMPLE_RADIAL";
  const Result result = Select(model);
  EXPECT_EQ(result.selected.camera_model, "SIMPLE_RADIAL");
  const std::size_t line = result.lines.find("camera model stays SIMPLE_RADIAL");
  EXPECT_NE(line, std::string::npos) << result.lines;
  EXPECT_EQ(result.lines.find("camera model stays", line + 1), std::string::npos) << result.lines;
  EXPECT_EQ(result.lines.find("focal length per picture"), std::string::npos) << result.lines;
}

}  // namespace
