// `pipeline normalize` on inputs made here: a foreign capture, NeRF-synthetic splits, the sfm stage's folder,
// a COLMAP workspace, and what must be refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "io/base/atomic_file.h"
#include "io/base/json.h"
#include "io/base/owned_folder.h"
#include "io/image/image.h"
#include "io/image/mask.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "pipeline/stages/scene_record.h"
#include "pipeline/stages/stages.h"
#include "tests/support/scenes/scene_matchers.h"

namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using io::Json;

constexpr int kFrames = 17;
constexpr int kWidth = 80, kHeight = 60;

io::Rigid3d OrbitPose(int i) {
  const double angle = 2 * std::numbers::pi * i / kFrames;
  const Vector3d back(std::cos(angle), std::sin(angle), 0), right = Vector3d::UnitZ().cross(back);
  io::Rigid3d pose;
  pose.rotation << right, Vector3d::UnitZ(), back;
  pose.translation = 10 * back;
  return pose;
}

std::string Name(int i) { return "img" + std::to_string(i); }  // img10 sorts after img2 only in natural order

class Normalize : public testing::Test {
 protected:
  ~Normalize() override { fs::remove_all(root_); }

  // An orbit of radius 10 around points within 2 of the origin.
  io::Scene WriteCapture(const fs::path& folder, const char* extension, double k1, int channels = 3) {
    io::Scene scene;
    scene.cameras = {
        {.width = kWidth, .height = kHeight, .fl_x = 70, .fl_y = 70, .cx = 40, .cy = 30, .k1 = k1}};
    for (int i = 0; i < kFrames; ++i) {
      io::Image image = io::MakeImage(kWidth, kHeight, channels);
      for (std::size_t k = 0; k < image.data.size(); ++k)
        image.data[k] = static_cast<std::uint8_t>(40 + static_cast<std::size_t>(i) + (k / 3) % 100);
      scene.frames.push_back({folder / "images" / (Name(i) + extension), 0, OrbitPose(i)});
      io::WriteImage(scene.frames.back().image_path, image);
    }
    for (int i = 0; i < 200; ++i) {
      io::Point3D point;
      point.xyz = 2 * Vector3d(std::sin(i), std::sin(2.3 * i), std::sin(3.7 * i + 1));
      scene.points.push_back(point);
    }
    io::WritePly(folder / "points.ply", scene.points);
    io::WriteTransforms(folder / "transforms.json", scene, "points.ply");
    return scene;
  }

  int Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"pipeline-normalize", "--out", out_.string(), "--threads", "2"});
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    return pipeline::RunNormalize(static_cast<int>(argv.size()), argv.data());
  }
  Json Record() const { return io::ParseJson(io::ReadFile(out_ / "scene/scene.json")); }
  io::TransformsFile Split(const std::string& split) const {
    return io::ReadTransforms(out_ / ("scene/transforms_" + split + ".json"));
  }

  fs::path root_ = fs::temp_directory_path() / ("pipeline_normalize_test_" + std::to_string(getpid()));
  fs::path in_ = root_ / "in", out_ = root_ / "run";
};

TEST_F(Normalize, ForeignCaptureIsUndistortedResizedScaledAndSplit) {
  const io::Scene input = WriteCapture(in_, ".jpg", 0.05);
  ASSERT_EQ(Run({"--poses", in_.string(), "--image-size", "40"}), 0);
  const auto train = Split("train"), test = Split("test");
  ASSERT_EQ(test.scene.frames.size(), 3u);
  EXPECT_EQ(train.scene.frames.size(), 14u);
  EXPECT_EQ(test.scene.frames[1].image_path, out_ / "scene/images/img8.png");
  EXPECT_EQ(test.scene.frames[2].image_path, out_ / "scene/images/img16.png");
  EXPECT_EQ(train.scene.frames[1].image_path, out_ / "scene/images/img2.png");
  EXPECT_EQ(test.scene.cameras.at(0).width, 40);
  EXPECT_EQ(test.scene.cameras.at(0).height, 30);
  EXPECT_FALSE(test.scene.cameras[0].HasDistortion());
  EXPECT_FALSE(fs::exists(out_ / "scene/undistorted"));
  EXPECT_EQ(train.scene.points.size(), input.points.size());

  const Json record = Record();
  EXPECT_EQ(record["near"], 2);
  EXPECT_EQ(record["far"], 6);
  EXPECT_EQ(record["unbounded"], false);
  EXPECT_EQ(record["protocol"], "capture");
  EXPECT_GT(record["coverage"].get<double>(), 0.98);
  EXPECT_EQ(record["held_out"], Json({"img0.png", "img8.png", "img16.png"}));
  EXPECT_EQ(record["missing_images"], Json::array());
  EXPECT_FALSE(record.contains("masks"));
  EXPECT_TRUE(train.has_near_far);
  const double scale = record["scene_from_sfm"]["scale"];
  EXPECT_EQ(train.scene.scene_from_sfm.scale, scale);
  // The stored chain leads from the input's poses to the written ones.
  const io::Rigid3d expected = io::TransformPose(test.scene.scene_from_sfm, input.frames[8].world_from_cam);
  EXPECT_THAT(test.scene.frames[1].world_from_cam, tests::PoseNear(expected, 1e-12));
}

TEST_F(Normalize, RunAgainIsUpToDateUntilAPictureChanges) {
  WriteCapture(in_, ".png", 0);
  ASSERT_EQ(Run({"--poses", in_.string()}), 0);
  const auto first = fs::last_write_time(out_ / "scene/scene.json");
  ASSERT_EQ(Run({"--poses", in_.string()}), 0);
  EXPECT_EQ(fs::last_write_time(out_ / "scene/scene.json"), first);
  io::WriteImage(in_ / "images/img3.png", io::MakeImage(kWidth, kHeight, 3));
  ASSERT_EQ(Run({"--poses", in_.string()}), 0);
  EXPECT_NE(fs::last_write_time(out_ / "scene/scene.json"), first);
  EXPECT_EQ(io::ReadFile(out_ / "scene/images/img3.png"), io::ReadFile(in_ / "images/img3.png"));
}

// Masks are undistorted, shrunk and split as their pictures are; a picture without one stays whole.
TEST_F(Normalize, MasksFollowTheirPicturesIntoBothSplits) {
  for (const double k1 : {0.0, 0.05}) {
    // The left half of every picture but one is used.
    io::Scene scene = WriteCapture(in_, ".jpg", k1);
    io::Mask mask{kWidth, kHeight, {}};
    for (int i = 0; i < kWidth * kHeight; ++i) mask.used.push_back(i % kWidth < kWidth / 2 ? 255 : 0);
    for (int i = 0; i < kFrames; ++i) {
      if (i == 3) continue;
      scene.frames[static_cast<std::size_t>(i)].mask_path = in_ / "masks" / (Name(i) + ".png");
      io::WriteMask(in_ / "masks" / (Name(i) + ".png"), mask);
    }
    io::WriteTransforms(in_ / "transforms.json", scene, "points.ply");
    ASSERT_EQ(Run({"--poses", in_.string(), "--image-size", "40"}), 0);
    int n_masks = 0;
    for (const std::string split : {"train", "test"}) {
      for (const io::Frame& frame : Split(split).scene.frames) {
        const std::string stem = frame.image_path.stem().string();
        EXPECT_EQ(frame.mask_path, stem == "img3" ? "" : out_ / "scene/masks/images" / (stem + ".png"));
        if (frame.mask_path.empty()) continue;
        const io::Mask written = io::ReadMask(frame.mask_path, 40, 30);
        for (std::size_t p = 0; p < 1200; ++p) EXPECT_EQ(written.Uses(p), p % 40 < 20) << p << " " << k1;
        ++n_masks;
      }
    }
    EXPECT_EQ(n_masks, kFrames - 1);
    EXPECT_EQ(Record()["masks"], kFrames - 1);
    EXPECT_NEAR(Record()["used_share"], (0.5 * (kFrames - 1) + 1) / kFrames, 1e-12);
    EXPECT_EQ(pipeline::ReadSceneRecord(out_).masks, kFrames - 1);
    EXPECT_EQ(pipeline::ReadSceneRecord(out_).used_share, Record()["used_share"]);
  }
  const auto first = fs::last_write_time(out_ / "scene/scene.json");
  ASSERT_EQ(Run({"--poses", in_.string(), "--image-size", "40"}), 0);
  EXPECT_EQ(fs::last_write_time(out_ / "scene/scene.json"), first);
  io::WriteMask(in_ / "masks/img5.png", {kWidth, kHeight, std::vector<std::uint8_t>(kWidth * kHeight, 255)});
  ASSERT_EQ(Run({"--poses", in_.string(), "--image-size", "40"}), 0);
  EXPECT_NE(fs::last_write_time(out_ / "scene/scene.json"), first);
}

TEST_F(Normalize, TestPicturesThatAreTrainingPicturesTooAreReported) {
  const auto warnings = [&] {
    int count = 0;
    const Json record = Record();
    for (const Json& line : record["decisions"])
      count += line.get<std::string>().starts_with("warning: 1 test picture");
    return count;
  };
  WriteCapture(in_, ".png", 0);
  ASSERT_EQ(Run({"--poses", in_.string()}), 0);
  EXPECT_EQ(warnings(), 0);
  fs::copy_file(in_ / "images/img9.png", in_ / "images/img8.png", fs::copy_options::overwrite_existing);
  ASSERT_EQ(Run({"--poses", in_.string()}), 0);
  EXPECT_EQ(warnings(), 1);
}

TEST_F(Normalize, SparsePointsInOnePlaceAreNamedAndLeftOut) {
  io::Scene scene = WriteCapture(in_, ".png", 0);
  for (std::size_t i = 1; i < scene.points.size(); ++i) scene.points[i].xyz = {1, 2, 3};  // all but one
  io::WritePly(in_ / "points.ply", scene.points);
  ASSERT_EQ(Run({"--poses", in_.string()}), 0);
  EXPECT_TRUE(Split("train").scene.points.empty());
  EXPECT_THAT(io::DumpJson(Record()["decisions"]),
              testing::HasSubstr("the 200 sparse points lie in one place"));
}

TEST_F(Normalize, MissingPicturesAreNamed) {
  WriteCapture(in_, ".png", 0);
  fs::remove(in_ / "images/img5.png");
  ASSERT_EQ(Run({"--poses", (in_ / "transforms.json").string(), "--holdout-every", "4"}), 0);
  EXPECT_EQ(Record()["missing_images"], Json({"images/img5.png"}));
  EXPECT_EQ(Split("test").scene.frames.size(), 4u);
  EXPECT_EQ(Split("train").scene.frames.size(), 12u);
}

TEST_F(Normalize, ASectorIsNamedInTheProtocol) {
  WriteCapture(in_, ".png", 0);
  const std::string poses = (in_ / "transforms.json").string();
  ASSERT_EQ(Run({"--poses", poses, "--holdout", "sector", "--holdout-every", "4"}), 0);
  EXPECT_EQ(Record()["protocol"], "capture, sector");
  EXPECT_EQ(Split("test").scene.frames.size(), 5u);
  ASSERT_EQ(Run({"--poses", poses, "--holdout-every", "4"}), 0);
  EXPECT_EQ(Record()["protocol"], "capture");
}

TEST_F(Normalize, BlenderScenesPassThroughUnchanged) {
  for (const std::string split : {"train", "val", "test"}) {
    Json json = {{"camera_angle_x", 0.69}, {"frames", Json::array()}};
    for (int i = 0; i < 3; ++i) {
      io::Image image = io::MakeImage(20, 20, 4);
      image.data[0] = static_cast<std::uint8_t>(i + 10 * split[1]);
      io::WriteImage(in_ / split / ("r_" + std::to_string(i) + ".png"), image);
      const io::Rigid3d pose = OrbitPose(i);
      Json rows = Json::array();
      for (int r = 0; r < 3; ++r)
        rows.push_back({pose.rotation(r, 0), pose.rotation(r, 1), pose.rotation(r, 2), pose.translation[r]});
      rows.push_back({0, 0, 0, 1});
      json["frames"].push_back({{"file_path", "./" + split + "/r_" + std::to_string(i)},
                                {"rotation", 0.1},
                                {"transform_matrix", rows}});
    }
    std::ofstream(in_ / ("transforms_" + split + ".json")) << json;
  }
  ASSERT_EQ(Run({"--poses", in_.string()}), 0);
  for (const std::string split : {"train", "val", "test"}) {
    const auto file = Split(split);
    ASSERT_EQ(file.scene.frames.size(), 3u);
    EXPECT_EQ(file.scene.near, 2);
    EXPECT_EQ(file.scene.far, 6);
    EXPECT_EQ(file.scene.aabb.max, Vector3d::Constant(1.5));
    EXPECT_FALSE(file.scene.unbounded);
    EXPECT_EQ(file.scene.scene_from_sfm.scale, 1);
    EXPECT_EQ(file.scene.cameras.at(0).fl_x, 10 / std::tan(0.345));
    for (int i = 0; i < 3; ++i) {
      const io::Frame& frame = file.scene.frames[static_cast<std::size_t>(i)];
      EXPECT_EQ(frame.world_from_cam.translation, OrbitPose(i).translation);
      EXPECT_EQ(io::ReadFile(frame.image_path), io::ReadFile(in_ / split / frame.image_path.filename()));
    }
  }
  EXPECT_EQ(Record()["protocol"], "nerf-20-white");
  EXPECT_EQ(Record()["held_out"].size(), 3u);
  EXPECT_FALSE(fs::exists(out_ / "scene/points.ply"));
}

// COLMAP's text format: the world is the scene's, OpenCV axes, poses cam_from_world. Each point is seen by 3
// pictures.
void WriteColmapText(const fs::path& folder, const io::Scene& scene, int n_images) {
  fs::create_directories(folder);
  std::ofstream(folder / "cameras.txt") << "1 PINHOLE 80 60 70 70 40 30\n";
  std::ofstream images(folder / "images.txt"), points(folder / "points3D.txt");
  images.precision(17);
  points.precision(17);
  std::vector<std::string> features(static_cast<std::size_t>(n_images));
  std::vector<int> counts(static_cast<std::size_t>(n_images), 0);
  for (std::size_t p = 0; p < scene.points.size(); ++p) {
    const Vector3d& x = scene.points[p].xyz;
    points << p + 1 << " " << x.x() << " " << x.y() << " " << x.z() << " 9 8 7 0.5";
    for (int k = 0; k < 3; ++k) {
      const auto i = (p + static_cast<std::size_t>(k)) % static_cast<std::size_t>(n_images);
      const auto xy = io::ImgFromCam(scene.cameras[0], scene.frames[i].world_from_cam.Inverse() * x);
      points << " " << i + 1 << " " << counts[i]++;
      features[i] +=
          std::to_string(xy->x()) + " " + std::to_string(xy->y()) + " " + std::to_string(p + 1) + " ";
    }
    points << "\n";
  }
  for (std::size_t i = 0; i < features.size(); ++i) {
    const io::Rigid3d cam_from_world = io::FlipCameraAxes(scene.frames[i].world_from_cam).Inverse();
    const Eigen::Quaterniond q(cam_from_world.rotation);
    images << i + 1 << " " << q.w() << " " << q.x() << " " << q.y() << " " << q.z() << " "
           << cam_from_world.translation.transpose() << " 1 "
           << scene.frames[i].image_path.filename().string() << "\n"
           << features[i] << "\n";
  }
}

TEST_F(Normalize, ColmapWorkspaceUsesTheLargestModelAndItsTracks) {
  const io::Scene scene = WriteCapture(in_, ".jpg", 0);
  fs::remove(in_ / "transforms.json");
  WriteColmapText(in_ / "sparse/0", scene, 4);
  WriteColmapText(in_ / "sparse/1", scene, kFrames);
  ASSERT_EQ(Run({"--poses", in_.string()}), 0);
  EXPECT_EQ(Split("train").scene.frames.size() + Split("test").scene.frames.size(), std::size_t{kFrames});
  EXPECT_EQ(Record()["points"], 200);
  EXPECT_GT(Record()["coverage"].get<double>(), 0.98);
  // What COLMAP observed in its axes is where the written cameras see the written points (float32 in the
  // PLY).
  const io::Scene train = Split("train").scene;
  ASSERT_EQ(train.points.size(), scene.points.size());
  for (std::size_t p = 0; p < scene.points.size(); ++p) {
    const auto before =
        io::ImgFromCam(scene.cameras[0], scene.frames[1].world_from_cam.Inverse() * scene.points[p].xyz);
    const auto after =
        io::ImgFromCam(train.cameras[0], train.frames[0].world_from_cam.Inverse() * train.points[p].xyz);
    EXPECT_NEAR((*before - *after).norm(), 0, 1e-3);
    // Three pictures from p on observe it; those held out (every 8th) are no observers.
    std::vector<int> observers;
    for (std::size_t i = 0; i < kFrames; ++i) {
      const std::size_t after_first = (i + kFrames - p % kFrames) % kFrames;
      if (i % 8 != 0 && after_first < 3) observers.push_back(static_cast<int>(i - i / 8 - 1));
    }
    std::vector<int> found = train.points[p].frame_indices;
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, observers) << p;
  }
  EXPECT_TRUE(Split("test").scene.points.empty());
  EXPECT_EQ(Run({"--poses", (in_ / "sparse/0").string(), "--force"}), 0);  // named by the user: taken
  EXPECT_EQ(Split("train").scene.frames.size() + Split("test").scene.frames.size(), 4u);
}

TEST_F(Normalize, SfmStageGivesPicturesAndTheModelGivesTracks) {
  io::ClaimFolder(out_);
  const io::Scene scene = WriteCapture(out_ / "sfm", ".png", 0);
  io::Scene original = scene;  // the model names the pictures as they were before undistortion
  for (io::Frame& frame : original.frames) frame.image_path.replace_extension(".jpg");
  // A point that only the tracks expose: two observers, far away.
  original.points.push_back(original.points[0]);
  WriteColmapText(out_ / "sfm/sparse/0", original, kFrames);
  ASSERT_EQ(Run({}), 0);
  EXPECT_EQ(Record()["points"], 201);
  EXPECT_EQ(Record()["inputs"].size(), kFrames + 4u);  // pictures, transforms.json, three model files
  EXPECT_EQ(Split("test").scene.frames.size(), 3u);
}

TEST_F(Normalize, RefusesWithTheDocumentedCode) {
  const char* without_out[] = {"pipeline-normalize"};
  EXPECT_EQ(pipeline::RunNormalize(1, without_out), 2);
  EXPECT_EQ(Run({}), 3);  // no sfm/ yet
  EXPECT_EQ(Run({"--poses", (root_ / "nowhere").string()}), 3);
  EXPECT_EQ(Run({"--poses", root_.string(), "--holdout-every", "1"}), 2);
  EXPECT_EQ(Run({"--poses", root_.string(), "--image-size", "-1"}), 2);
  io::Scene scene = WriteCapture(in_, ".png", 0);
  for (io::Frame& frame : scene.frames) frame.world_from_cam.translation = {1, 2, 3};
  io::WriteTransforms(in_ / "transforms.json", scene, "");
  EXPECT_EQ(Run({"--poses", in_.string()}), 4);
  scene.frames.resize(1);
  io::WriteTransforms(in_ / "transforms.json", scene, "");
  EXPECT_EQ(Run({"--poses", in_.string()}), 4);
  EXPECT_FALSE(fs::exists(out_ / "scene"));
}

}  // namespace
