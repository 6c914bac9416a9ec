// COLMAP models that the test writes itself: round trip in both forms, each fault by name, and a mutation
// loop.
#include "io/colmap_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <random>

#include "io/atomic_file.h"
#include "io/colmap_records.h"
#include "io/error.h"

namespace {

namespace fs = std::filesystem;

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "colmap_model_XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~TemporaryFolder() { fs::remove_all(path_); }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

template <typename T>
void Put(std::string* bytes, T value) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

void WriteBytes(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

void WriteBinary(const io::ColmapRecords& records, const fs::path& folder) {
  std::string cameras, images, points;
  Put<std::uint64_t>(&cameras, records.cameras.size());
  for (const auto& camera : records.cameras) {
    Put(&cameras, camera.id);
    Put<std::int32_t>(&cameras, camera.model == "SIMPLE_RADIAL" ? 2 : camera.model == "OPENCV" ? 4 : 5);
    Put(&cameras, camera.width);
    Put(&cameras, camera.height);
    for (double value : camera.params) Put(&cameras, value);
  }
  Put<std::uint64_t>(&images, records.images.size());
  for (const auto& image : records.images) {
    Put(&images, image.id);
    for (double value : image.quaternion_wxyz) Put(&images, value);
    for (double value : image.translation) Put(&images, value);
    Put(&images, image.camera_id);
    images += image.name + '\0';
    Put<std::uint64_t>(&images, image.features.size());
    for (const auto& feature : image.features) {
      Put(&images, feature.x);
      Put(&images, feature.y);
      Put(&images, feature.point_id);
    }
  }
  Put<std::uint64_t>(&points, records.points.size());
  for (const auto& point : records.points) {
    Put(&points, point.id);
    for (double value : point.xyz) Put(&points, value);
    for (std::uint8_t value : point.rgb) Put(&points, value);
    Put(&points, point.error_px);
    Put<std::uint64_t>(&points, point.track.size());
    for (const auto& element : point.track) {
      Put(&points, element.image_id);
      Put(&points, element.feature_index);
    }
  }
  WriteBytes(folder / "cameras.bin", cameras);
  WriteBytes(folder / "images.bin", images);
  WriteBytes(folder / "points3D.bin", points);
}

void WriteText(const io::ColmapRecords& records, const fs::path& folder) {
  std::ofstream cameras(folder / "cameras.txt"), images(folder / "images.txt"),
      points(folder / "points3D.txt");
  for (std::ofstream* out : {&cameras, &images, &points}) {
    out->precision(17);
    *out << "# comment\n";
  }
  for (const auto& camera : records.cameras) {
    cameras << camera.id << " " << camera.model << " " << camera.width << " " << camera.height;
    for (double value : camera.params) cameras << " " << value;
    cameras << "\n";
  }
  for (const auto& image : records.images) {
    images << image.id;
    for (double value : image.quaternion_wxyz) images << " " << value;
    for (double value : image.translation) images << " " << value;
    images << " " << image.camera_id << " " << image.name << "\n";
    for (const auto& f : image.features) {
      images << f.x << " " << f.y << " " << static_cast<std::int64_t>(f.point_id) << " ";
    }
    images << "\n";
  }
  for (const auto& point : records.points) {
    points << point.id;
    for (double value : point.xyz) points << " " << value;
    for (int value : point.rgb) points << " " << value;
    points << " " << point.error_px;
    for (const auto& element : point.track) points << " " << element.image_id << " " << element.feature_index;
    points << "\n";
  }
}

// Three pictures (one of them without features), two cameras, four points. Every observation lies exactly 1
// px beside the projection.
io::ColmapRecords SmallModel() {
  io::ColmapRecords records;
  records.cameras = {
      {.id = 7, .model = "SIMPLE_RADIAL", .width = 640, .height = 480, .params = {500, 320, 240, 0.1}},
      {.id = 3,
       .model = "OPENCV",
       .width = 320,
       .height = 240,
       .params = {300, 310, 160, 120, 0.05, -0.01, 1e-3, -2e-3}}};
  const io::Camera cameras[] = {{640, 480, 500, 500, 320, 240, 0.1, 0, 0, 0},
                                {320, 240, 300, 310, 160, 120, 0.05, -0.01, 1e-3, -2e-3}};
  const double half = 0.2;  // both turn about y; the quaternion of cam_from_world
  records.images = {{.id = 11,
                     .camera_id = 7,
                     .quaternion_wxyz = {std::cos(half), 0, std::sin(half), 0},
                     .translation = {0.1, 0.2, 4},
                     .name = "view 10.png"},
                    {.id = 5,
                     .camera_id = 3,
                     .quaternion_wxyz = {std::cos(half), 0, -std::sin(half), 0},
                     .translation = {-0.1, 0.1, 5},
                     .name = "view 2.png"},
                    {.id = 6,
                     .camera_id = 3,
                     .quaternion_wxyz = {1, 0, 0, 0},
                     .translation = {0, 0, 1},
                     .name = "view 30.png"}};
  for (int i = 0; i < 4; ++i) {
    io::ColmapPointRecord point{.id = 100u + static_cast<std::uint64_t>(i) * 7,
                                .xyz = {0.3 * i - 0.4, 0.2 - 0.1 * i, 0.15 * i},
                                .rgb = {static_cast<std::uint8_t>(i), 128, 255},
                                .error_px = 0.5};
    for (int k = 0; k < 2; ++k) {
      auto& image = records.images[static_cast<std::size_t>(k)];
      const auto& q = image.quaternion_wxyz;
      const Eigen::Vector3d x_cv =
          Eigen::Quaterniond(q[0], q[1], q[2], q[3]) *
              Eigen::Vector3d(point.xyz[0], point.xyz[1], point.xyz[2]) +
          Eigen::Vector3d(image.translation[0], image.translation[1], image.translation[2]);
      const Eigen::Vector2d xy = *io::ImgFromCam(cameras[k], {x_cv.x(), -x_cv.y(), -x_cv.z()});
      image.features.push_back({1, 2, io::kNoPoint});
      image.features.push_back({xy.x() + 1, xy.y(), point.id});
      point.track.push_back({image.id, static_cast<std::uint32_t>(image.features.size() - 1)});
    }
    records.points.push_back(point);
  }
  return records;
}

void ExpectSmallModel(const io::ColmapModel& model) {
  const io::Scene& scene = model.scene;
  ASSERT_EQ(scene.cameras.size(), 2u);
  EXPECT_EQ(scene.cameras[0], (io::Camera{640, 480, 500, 500, 320, 240, 0.1, 0, 0, 0}));
  EXPECT_EQ(scene.cameras[1], (io::Camera{320, 240, 300, 310, 160, 120, 0.05, -0.01, 1e-3, -2e-3}));
  ASSERT_EQ(scene.frames.size(), 3u);
  EXPECT_EQ(scene.frames[0].image_path, "view 2.png");  // natural order
  // cam_from_world = (I, (0, 0, 1)): the centre is at z = -1, and the camera looks along +z of the world.
  EXPECT_NEAR((scene.frames[2].world_from_cam.translation - Eigen::Vector3d(0, 0, -1)).norm(), 0, 1e-15);
  EXPECT_NEAR(
      (scene.frames[2].world_from_cam.rotation * Eigen::Vector3d(0, 0, -1) - Eigen::Vector3d(0, 0, 1)).norm(),
      0,
      1e-15);
  ASSERT_EQ(scene.points.size(), 4u);
  EXPECT_EQ(scene.points[2].rgb, (std::array<std::uint8_t, 3>{2, 128, 255}));
  EXPECT_EQ(scene.points[2].frame_indices, (std::vector<int>{1, 0}));
  EXPECT_EQ(model.camera_model, "SIMPLE_RADIAL");
  ASSERT_EQ(model.observations.size(), 8u);  // point by point, in the order of the tracks
  for (std::size_t i = 0; i < 8; ++i) {
    const io::Observation& observation = model.observations[i];
    EXPECT_EQ(observation.point_index, static_cast<int>(i / 2));
    EXPECT_EQ(observation.frame_index, scene.points[i / 2].frame_indices[i % 2]);
    const io::Frame& frame = scene.frames[static_cast<std::size_t>(observation.frame_index)];
    const Eigen::Vector2d projected =
        *io::ImgFromCam(scene.cameras[static_cast<std::size_t>(frame.camera_index)],
                        frame.world_from_cam.Inverse() * scene.points[i / 2].xyz);
    EXPECT_NEAR((observation.xy - projected - Eigen::Vector2d(1, 0)).norm(), 0, 1e-9);
  }
  EXPECT_EQ(model.mean_track_length, 2);
  EXPECT_NEAR(model.mean_reprojection_error_px, 1, 1e-9);  // pins axes, pose and distortion conventions
}

TEST(ColmapModel, BinaryRoundTripBesideTheRigsOfNewerVersions) {
  const TemporaryFolder folder;
  EXPECT_FALSE(io::IsColmapModel(folder.path()));
  WriteBinary(SmallModel(), folder.path());
  EXPECT_TRUE(io::IsColmapModel(folder.path()));
  WriteBytes(folder.path() / "rigs.bin", "x");
  WriteBytes(folder.path() / "frames.bin", "x");
  ExpectSmallModel(io::ReadColmapModel(folder.path()));
}

TEST(ColmapModel, TextRoundTripKeepsNamesWithBlanksAndEmptyFeatureLines) {
  const TemporaryFolder folder;
  WriteText(SmallModel(), folder.path());
  ExpectSmallModel(io::ReadColmapModel(folder.path()));
}

TEST(ColmapModel, WrittenModelsAreReadBackExactly) {
  // One camera for each model that the writer knows, then everything a model holds.
  const io::Camera pinhole{.width = 64, .height = 48, .fl_x = 50.1, .fl_y = 50.1, .cx = 32, .cy = 24.3};
  std::vector<std::pair<std::string, io::Camera>> cases(6, {"SIMPLE_PINHOLE", pinhole});
  cases[1].first = "PINHOLE", cases[1].second.fl_y = 50.2;
  cases[2].first = "SIMPLE_RADIAL", cases[2].second.k1 = 0.1;
  cases[3].first = "RADIAL", cases[3].second.k2 = -1.0 / 3;
  cases[4].first = "OPENCV", cases[4].second.p2 = 1e-300;
  cases[5].first = "OPENCV", cases[5].second.fl_y = 49, cases[5].second.k1 = 0.1;
  for (const auto& [name, camera] : cases) {
    const TemporaryFolder folder;
    io::ColmapModel model;
    model.scene.cameras = {camera};
    io::WriteColmapModel(folder.path(), model);
    const io::ColmapModel read = io::ReadColmapModel(folder.path());
    EXPECT_EQ(read.camera_model, name);
    EXPECT_EQ(read.scene.cameras, model.scene.cameras);
  }
  EXPECT_EQ(cases.size(), 6u);

  const TemporaryFolder first, second;
  WriteBinary(SmallModel(), first.path());
  const io::ColmapModel model = io::ReadColmapModel(first.path());
  io::WriteColmapModel(second.path(), model);
  const io::ColmapModel read = io::ReadColmapModel(second.path());
  ExpectSmallModel(read);
  EXPECT_EQ(read.observations, model.observations);
  EXPECT_EQ(read.scene.cameras, model.scene.cameras);
  for (std::size_t i = 0; i < 3; ++i) {
    const io::Frame &a = model.scene.frames[i], &b = read.scene.frames[i];
    EXPECT_EQ(a.image_path, b.image_path);
    EXPECT_EQ(a.camera_index, b.camera_index);
    // Matrix to quaternion and back: a few roundings of numbers up to 5.
    EXPECT_LT((a.world_from_cam.rotation - b.world_from_cam.rotation).norm(), 2e-15);
    EXPECT_LT((a.world_from_cam.translation - b.world_from_cam.translation).norm(), 1e-14);
  }
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(model.scene.points[i].xyz, read.scene.points[i].xyz);
    EXPECT_EQ(model.scene.points[i].error_px, read.scene.points[i].error_px);
    EXPECT_EQ(model.scene.points[i].frame_indices, read.scene.points[i].frame_indices);
  }
}

void ExpectError(const fs::path& folder, io::ExitCode code, const std::string& words) {
  try {
    io::ReadColmapModel(folder);
    FAIL() << "accepted, expected: " << words;
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

TEST(ColmapModel, EachFaultIsNamed) {
  using Records = io::ColmapRecords;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::pair<std::string, std::function<void(Records*)>>> faults = {
      {"camera 7 appears twice", [](Records* r) { r->cameras[1].id = 7; }},
      {"camera 7 has the size 0x480", [](Records* r) { r->cameras[0].width = 0; }},
      {"camera 3 has the size", [](Records* r) { r->cameras[1].height = std::uint64_t{1} << 40; }},
      {"camera 7 has a focal length that is not positive", [](Records* r) { r->cameras[0].params[0] = -5; }},
      {"camera 3 has a parameter that is not finite", [](Records* r) { r->cameras[1].params[4] = kNan; }},
      {"image 11 has a pose that is not finite", [](Records* r) { r->images[0].quaternion_wxyz[0] = kNan; }},
      {"image 5 has a quaternion", [](Records* r) { r->images[1].quaternion_wxyz = {}; }},
      {"image 6 has a pose that is not finite", [](Records* r) { r->images[2].translation[1] = HUGE_VAL; }},
      {"refers to the missing camera 9", [](Records* r) { r->images[0].camera_id = 9; }},
      {"image 11 appears twice", [](Records* r) { r->images[2].id = 11; }},
      {"the name 'view 2.png' appears twice", [](Records* r) { r->images[2].name = "view 2.png"; }},
      {"unsafe name", [](Records* r) { r->images[0].name = "../x.png"; }},
      {"unsafe name", [](Records* r) { r->images[0].name = "/etc/x.png"; }},
      {"point 100 is not finite", [](Records* r) { r->points[0].xyz[2] = kNan; }},
      {"point 107 appears twice", [](Records* r) { r->points[2].id = 107; }},
      {"refers to the missing image 99", [](Records* r) { r->points[0].track[0].image_id = 99; }},
      {"which does not refer back", [](Records* r) { r->points[0].track[0].feature_index = 0; }},
      {"which does not refer back", [](Records* r) { r->points[0].track[0].feature_index = 1000; }},
      {"refers to points 8 times", [](Records* r) { r->points[3].track.pop_back(); }},
      {"refers to points 9 times", [](Records* r) { r->images[0].features[0].point_id = 4711; }},
      {"has a feature that is not finite", [](Records* r) { r->images[0].features[1].x = kNan; }},
  };
  for (const auto& [words, damage] : faults) {
    const TemporaryFolder folder;
    io::ColmapRecords records = SmallModel();
    damage(&records);
    WriteBinary(records, folder.path());
    ExpectError(folder.path(), io::ExitCode::kBadState, words);
  }
  EXPECT_EQ(faults.size(), 21u);
}

TEST(ColmapModel, CountsAreCheckedBeforeAllocation) {
  for (const char* file : {"cameras.bin", "images.bin", "points3D.bin"}) {
    for (const std::uint64_t count : {std::uint64_t{1000}, std::uint64_t{1} << 60, std::uint64_t{1} << 62}) {
      const TemporaryFolder folder;
      WriteBinary(SmallModel(), folder.path());
      std::string bytes = io::ReadFile(folder.path() / file);
      std::memcpy(bytes.data(), &count, sizeof count);
      WriteBytes(folder.path() / file, bytes);
      ExpectError(folder.path(), io::ExitCode::kBadState, file);
    }
  }
}

TEST(ColmapModel, TruncatedAndPaddedFilesAreRefusedAtEveryLength) {
  int cases = 0;
  for (const char* file : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const TemporaryFolder folder;
    WriteBinary(SmallModel(), folder.path());
    const std::string bytes = io::ReadFile(folder.path() / file);
    for (std::size_t size = 0; size < bytes.size(); ++size, ++cases) {
      WriteBytes(folder.path() / file, bytes.substr(0, size));
      EXPECT_THROW(io::ReadColmapModel(folder.path()), io::Error) << file << " cut to " << size;
    }
    WriteBytes(folder.path() / file, bytes + "x");
    ExpectError(folder.path(), io::ExitCode::kBadState, "1 bytes after its last record");
  }
  EXPECT_GT(cases, 700);
}

TEST(ColmapModel, UnsupportedAndUndefinedCameraModels) {
  const TemporaryFolder folder;
  io::ColmapRecords records = SmallModel();
  records.cameras[1].model = "OPENCV_FISHEYE";
  WriteBinary(records, folder.path());
  ExpectError(folder.path(), io::ExitCode::kBadInput, "Undistort first");
  std::string bytes = io::ReadFile(folder.path() / "cameras.bin");
  bytes[12] = 99;
  WriteBytes(folder.path() / "cameras.bin", bytes);
  ExpectError(folder.path(), io::ExitCode::kBadState, "camera 7 has the undefined model number 99");
}

TEST(ColmapModel, TextFaults) {
  const TemporaryFolder folder;
  WriteText(SmallModel(), folder.path());
  const std::string cameras = io::ReadFile(folder.path() / "cameras.txt");
  WriteBytes(folder.path() / "cameras.txt", cameras + "8 SIMPLE_RADIAL 640 480 500 320 240\n");
  ExpectError(folder.path(), io::ExitCode::kBadState, "camera 8 has 3 parameters, SIMPLE_RADIAL needs 4");
  WriteBytes(folder.path() / "cameras.txt", cameras + "8 MAGIC 640 480 500\n");
  ExpectError(folder.path(), io::ExitCode::kBadState, "camera 8 has the undefined model 'MAGIC'");
  WriteBytes(folder.path() / "cameras.txt", cameras + "8 PINHOLE -640 480 500 500 320 240\n");
  ExpectError(folder.path(), io::ExitCode::kBadState, "line 4: '-640' is not a number in range");
  WriteBytes(folder.path() / "cameras.txt", cameras + "8 PINHOLE 640\n");
  ExpectError(folder.path(), io::ExitCode::kBadState, "line 4 ends too early");
}

TEST(ColmapModel, DamagedBytesNeverDoMoreThanThrow) {
  const TemporaryFolder folders[2];
  WriteBinary(SmallModel(), folders[0].path());
  WriteText(SmallModel(), folders[1].path());
  std::mt19937 random(7);
  int parsed = 0, refused = 0;
  for (int i = 0; i < 3000; ++i) {
    const fs::path& folder = folders[i % 2].path();
    const char* stems[] = {"cameras", "images", "points3D"};
    const fs::path file = folder / (std::string(stems[random() % 3]) + (i % 2 == 0 ? ".bin" : ".txt"));
    const std::string intact = io::ReadFile(file);
    std::string bytes = intact;
    for (unsigned flips = 1 + random() % 3; flips > 0; --flips) {
      bytes[random() % bytes.size()] = static_cast<char>(random());
    }
    if (random() % 4 == 0) bytes.resize(random() % bytes.size());
    WriteBytes(file, bytes);
    try {
      const io::ColmapModel model = io::ReadColmapModel(folder);
      for (const io::Frame& frame : model.scene.frames) {
        EXPECT_TRUE(frame.world_from_cam.translation.allFinite());
      }
      ++parsed;
    } catch (const io::Error&) {
      ++refused;
    }
    WriteBytes(file, intact);
  }
  EXPECT_EQ(parsed + refused, 3000);
  EXPECT_GT(parsed, 100);
  EXPECT_GT(refused, 1000);
}

TEST(ColmapModel, ReadsTheBookModel) {
  const char* data = std::getenv("PIPELINE_DATA");
  const fs::path folder =
      fs::path(data ? data : SOURCE_DIR "/../shared/data") / "book_colmap" / "sparse" / "0";
  if (!io::IsColmapModel(folder)) GTEST_SKIP() << folder << " is absent";
  const io::ColmapModel model = io::ReadColmapModel(folder);
  EXPECT_EQ(model.scene.frames.size(), 7u);
  EXPECT_GT(model.scene.points.size(), 500u);
  EXPECT_LT(model.mean_reprojection_error_px, 1.5);
}

}  // namespace
