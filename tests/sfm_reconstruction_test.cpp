// Small rendered captures through the installed COLMAP: a walk is reconstructed to its true poses, a camera
// that only turns is refused by name.
#include "sfm/reconstruction.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>

#include "io/error.h"
#include "io/image.h"
#include "io/process.h"

namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 400, kHeight = 300;
const io::Camera kCamera{.width = kWidth, .height = kHeight, .fl_x = 380, .fl_y = 380, .cx = 200, .cy = 150};

// A value in [0, 1] for each cell of a grid, without tables.
double CellValue(int x, int y, int layer) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 374761393u + static_cast<std::uint32_t>(y) * 668265263u +
                    static_cast<std::uint32_t>(layer) * 2246822519u;
  h = (h ^ (h >> 13)) * 1274126177u;
  return static_cast<double>((h ^ (h >> 16)) & 0xffff) / 65535;
}

// Patches of several sizes, smoothed linearly.
double Texture(double u, double v, int wall) {
  double sum = 0;
  for (int octave = 0; octave < 4; ++octave) {
    const double scale = 4 << octave, x = u * scale, y = v * scale;
    const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
    const double fx = x - ix, fy = y - iy;
    const int layer = wall * 16 + octave;
    const double top = std::lerp(CellValue(ix, iy, layer), CellValue(ix + 1, iy, layer), fx);
    const double bottom = std::lerp(CellValue(ix, iy + 1, layer), CellValue(ix + 1, iy + 1, layer), fx);
    sum += std::lerp(top, bottom, fy);
  }
  return sum / 4;
}

// Inside of the box [-2, 2]^3 with a second, smaller box in the middle of the view.
double Shade(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  double nearest = 1e9, value = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double plane : {-2.0, 2.0, -0.5, 0.5}) {
      const double t = (plane - origin[axis]) / direction[axis];
      if (!(t > 1e-6) || t >= nearest) continue;
      const Eigen::Vector3d x = origin + t * direction;
      const double u = x[(axis + 1) % 3], v = x[(axis + 2) % 3];
      const bool inner = std::abs(plane) < 1;
      if (inner && (std::abs(u) > 0.5 || std::abs(v) > 0.5)) continue;
      nearest = t;
      value = Texture(u + 10, v + 10, axis * 4 + static_cast<int>(plane * 2 + 4));
    }
  }
  return value;
}

io::Rigid3d LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  io::Rigid3d pose;
  const Eigen::Vector3d back = (eye - target).normalized();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(back).normalized();
  pose.rotation << right, back.cross(right), back;
  pose.translation = eye;
  return pose;
}

class SmallCapture : public testing::Test {
 protected:
  SmallCapture() {
    std::string name = (fs::temp_directory_path() / "reconstruction_XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~SmallCapture() override { fs::remove_all(folder_); }

  void Add(const io::Rigid3d& world_from_cam) {
    io::Image image = io::MakeImage(kWidth, kHeight, 3);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const Eigen::Vector3d ray = world_from_cam.rotation * *io::RayFromImg(kCamera, {x + 0.5, y + 0.5});
        const auto grey =
            static_cast<std::uint8_t>(std::lround(255 * Shade(world_from_cam.translation, ray)));
        for (int c = 0; c < 3; ++c) image.Pixel(x, y)[c] = grey;
      }
    }
    const std::string name = "p" + std::to_string(pictures_.size()) + ".png";
    fs::create_directories(folder_ / "images");
    io::WriteImage(folder_ / "images" / name, image);
    pictures_.push_back({.name = name, .width = kWidth, .height = kHeight, .focal_px = 380});
    truth_.push_back(world_from_cam);
  }

  sfm::Reconstruction Run(sfm::ReconstructionOptions options = {.features = 600, .threads = 2}) {
    return sfm::Reconstruct(
        pictures_, folder_ / "images", folder_ / "work", options, [this](const std::string& line) {
          decisions_.push_back(line);
        });
  }

  fs::path folder_;
  std::vector<sfm::Picture> pictures_;
  std::vector<io::Rigid3d> truth_;
  std::vector<std::string> decisions_;
};

TEST_F(SmallCapture, AWalkIsReconstructedToItsTruePoses) {
  if (!io::FindProgram("colmap")) GTEST_SKIP() << "colmap is not installed";
  for (int i = 0; i < 7; ++i) {
    const double angle = 0.14 * i;
    Add(LookAt({1.6 * std::sin(angle), 0.2 * std::sin(5 * angle), 1.6 * std::cos(angle)}, {0, 0, 0}));
  }
  const sfm::Reconstruction result = Run();
  const io::Scene& scene = result.model.scene;
  ASSERT_EQ(scene.frames.size(), 7u);
  EXPECT_TRUE(result.unregistered.empty());
  EXPECT_GT(scene.points.size(), 100u);
  EXPECT_LT(result.model.mean_reprojection_error_px, 1.0);
  EXPECT_GT(result.triangulation_angle_deg, 5);
  EXPECT_TRUE(fs::exists(result.database));
  EXPECT_FALSE(decisions_.empty());
  // The world is free up to a similarity: compare rotations, and ratios of distances, between pictures.
  const auto& frames = scene.frames;
  const double scale = (truth_[6].translation - truth_[0].translation).norm() /
                       (frames[6].world_from_cam.translation - frames[0].world_from_cam.translation).norm();
  for (std::size_t i = 1; i < 7; ++i) {
    const Eigen::Matrix3d estimated =
        frames[0].world_from_cam.rotation.transpose() * frames[i].world_from_cam.rotation;
    const Eigen::Matrix3d expected = truth_[0].rotation.transpose() * truth_[i].rotation;
    EXPECT_LT(Eigen::AngleAxisd(estimated.transpose() * expected).angle() * 180 / EIGEN_PI, 0.5) << i;
    EXPECT_NEAR((frames[0].world_from_cam.Inverse() * frames[i].world_from_cam.translation * scale -
                 truth_[0].Inverse() * truth_[i].translation)
                    .norm(),
                0,
                0.03)
        << i;
  }
}

TEST_F(SmallCapture, TheNumberOfThreadsChangesNoBit) {
  if (!io::FindProgram("colmap")) GTEST_SKIP() << "colmap is not installed";
  for (int i = 0; i < 5; ++i)
    Add(LookAt({1.6 * std::sin(0.16 * i), 0.1 * i, 1.6 * std::cos(0.16 * i)}, {0, 0, 0}));
  const sfm::Reconstruction one = Run({.features = 600, .threads = 1});
  fs::remove_all(folder_ / "work");
  const sfm::Reconstruction three = Run({.features = 600, .threads = 3});
  const auto &a = one.model.scene, &b = three.model.scene;
  ASSERT_EQ(a.frames.size(), 5u);
  ASSERT_EQ(b.frames.size(), 5u);
  EXPECT_EQ(a.cameras, b.cameras);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(a.frames[i].world_from_cam.rotation, b.frames[i].world_from_cam.rotation) << i;
    EXPECT_EQ(a.frames[i].world_from_cam.translation, b.frames[i].world_from_cam.translation) << i;
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) ASSERT_EQ(a.points[i].xyz, b.points[i].xyz) << i;
}

TEST_F(SmallCapture, AStrongerAttemptIsMadeAndItsReasonGiven) {
  if (!io::FindProgram("colmap")) GTEST_SKIP() << "colmap is not installed";
  for (int i = 0; i < 5; ++i)
    Add(LookAt({1.6 * std::sin(0.16 * i), 0.1 * i, 1.6 * std::cos(0.16 * i)}, {0, 0, 0}));
  // Nothing in common with the others.
  fs::create_directories(folder_ / "images");
  io::Image noise = io::MakeImage(kWidth, kHeight, 3);
  for (std::size_t i = 0; i < noise.data.size(); ++i) {
    noise.data[i] = static_cast<std::uint8_t>(255 * CellValue(static_cast<int>(i / 3), 7, 99));
  }
  io::WriteImage(folder_ / "images" / "stranger.png", noise);
  pictures_.push_back({.name = "stranger.png", .width = kWidth, .height = kHeight, .focal_px = 380});
  const sfm::Reconstruction result = Run();
  ASSERT_EQ(result.unregistered.size(), 1u);
  EXPECT_EQ(result.unregistered[0].name, "stranger.png");
  EXPECT_EQ(result.unregistered[0].cause.substr(0, 11), "no overlap:") << result.unregistered[0].cause;
  bool tried = false;
  for (const std::string& line : decisions_) tried |= line.find("trying again with") != std::string::npos;
  EXPECT_TRUE(tried);
}

void ExpectCause(const std::function<void()>& run, const std::string& cause) {
  try {
    run();
    FAIL() << "accepted, expected: " << cause;
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kNotReconstructible) << error.what();
    EXPECT_EQ(std::string(error.what()).substr(0, cause.size()), cause);
  }
}

TEST_F(SmallCapture, ACameraThatOnlyTurnsHasNoBaseline) {
  if (!io::FindProgram("colmap")) GTEST_SKIP() << "colmap is not installed";
  for (int i = 0; i < 7; ++i) {
    const double angle = 0.1 * i;
    const Eigen::Vector3d eye(0.2, 0.1, 1.6);
    Add(LookAt(eye, eye - Eigen::Vector3d(std::sin(angle), 0.3 * std::sin(3 * angle), std::cos(angle))));
  }
  ExpectCause([&] { Run(); }, "no baseline: ");
}

TEST_F(SmallCapture, BlankPicturesHaveNoTexture) {
  if (!io::FindProgram("colmap")) GTEST_SKIP() << "colmap is not installed";
  fs::create_directories(folder_ / "images");
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    io::Image image = io::MakeImage(kWidth, kHeight, 3);
    std::fill(image.data.begin(), image.data.end(), std::uint8_t{128});
    io::WriteImage(folder_ / "images" / name, image);
    pictures_.push_back({.name = name, .width = kWidth, .height = kHeight});
  }
  ExpectCause([&] { Run(); }, "no texture: ");
}

TEST_F(SmallCapture, TwoPicturesAreTooFew) {
  pictures_ = {{.name = "a.png"}, {.name = "b.png"}};
  ExpectCause([&] { Run(); }, "too few pictures: 2");
}

TEST_F(SmallCapture, UnknownOptionsAreUsageErrors) {
  for (const sfm::ReconstructionOptions& options : {sfm::ReconstructionOptions{.camera_model = "FISHEYE"},
                                                    sfm::ReconstructionOptions{.matching = "magic"},
                                                    sfm::ReconstructionOptions{.detector = "orb"},
                                                    sfm::ReconstructionOptions{.features = 5}}) {
    try {
      Run(options);
      FAIL();
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), io::ExitCode::kUsage);
    }
  }
}

}  // namespace
