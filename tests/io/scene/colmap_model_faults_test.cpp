// Damaged COLMAP models: each fault by name, and a mutation loop.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/scene/colmap_model.h"
#include "tests/support/files/small_colmap_model.h"

namespace {

namespace fs = std::filesystem;

// The error has this code and names the file, and what is wrong in it.
void ExpectError(const fs::path& folder, io::ExitCode code, const std::vector<std::string>& names) {
  try {
    io::ReadColmapModel(folder);
    FAIL() << "accepted, expected an error about " << names.back();
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    for (const std::string& name : names) {
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << name << ": " << error.what();
    }
  }
}

TEST(ColmapModelFaults, EachFaultIsNamed) {
  using Records = io::ColmapRecords;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::string cameras = "cameras.bin", images = "images.bin", points = "points3D.bin";
  const std::vector<std::pair<std::vector<std::string>, std::function<void(Records*)>>> faults = {
      {{cameras, "camera 7", "twice"}, [](Records* r) { r->cameras[1].id = 7; }},
      {{cameras, "camera 7", "size 0x480"}, [](Records* r) { r->cameras[0].width = 0; }},
      {{cameras, "camera 3", "1099511627776"},
       [](Records* r) { r->cameras[1].height = std::uint64_t{1} << 40; }},
      {{cameras, "camera 7", "focal length"}, [](Records* r) { r->cameras[0].params[0] = -5; }},
      {{cameras, "camera 7", "focal length of 1e+07"}, [](Records* r) { r->cameras[0].params[0] = 1e7; }},
      {{cameras, "camera 7", "principal point"}, [](Records* r) { r->cameras[0].params[1] = -1; }},
      {{cameras, "camera 3", "finite"}, [](Records* r) { r->cameras[1].params[4] = kNan; }},
      {{images, "image 11", "pose that is not finite"},
       [](Records* r) { r->images[0].quaternion_wxyz[0] = kNan; }},
      {{images, "image 5", "quaternion"}, [](Records* r) { r->images[1].quaternion_wxyz = {}; }},
      {{images, "image 6", "pose that is not finite"},
       [](Records* r) { r->images[2].translation[1] = HUGE_VAL; }},
      {{images, "image 11", "missing camera 9"}, [](Records* r) { r->images[0].camera_id = 9; }},
      {{images, "image 11", "twice"}, [](Records* r) { r->images[2].id = 11; }},
      {{images, "'view 2.png'", "twice"}, [](Records* r) { r->images[2].name = "view 2.png"; }},
      {{images, "image 11", "unsafe"}, [](Records* r) { r->images[0].name = "../x.png"; }},
      {{images, "image 11", "unsafe"}, [](Records* r) { r->images[0].name = "/etc/x.png"; }},
      {{points, "point 100", "finite"}, [](Records* r) { r->points[0].xyz[2] = kNan; }},
      {{points, "point 107", "twice"}, [](Records* r) { r->points[2].id = 107; }},
      {{points, "point 100", "missing image 99"}, [](Records* r) { r->points[0].track[0].image_id = 99; }},
      {{points, "point 100", "feature 0", "refer back"},
       [](Records* r) { r->points[0].track[0].feature_index = 0; }},
      {{points, "point 100", "feature 1000", "refer back"},
       [](Records* r) { r->points[0].track[0].feature_index = 1000; }},
      {{images, points, "points 8 times"}, [](Records* r) { r->points[3].track.pop_back(); }},
      {{images, points, "points 9 times"}, [](Records* r) { r->images[0].features[0].point_id = 4711; }},
      {{images, "image 11", "feature that is not finite"},
       [](Records* r) { r->images[0].features[1].x = kNan; }},
      {{points, "point 100", "1e9"}, [](Records* r) { r->points[0].xyz[1] = -1e300; }},
      {{images, "image 11", "1e9"}, [](Records* r) { r->images[0].translation[2] = 1.1e9; }},
      {{images, "image 11", "unsafe name"}, [](Records* r) { r->images[0].name = "caf\xe9.jpg"; }},
      {{images, "image 11", "unsafe name"}, [](Records* r) { r->images[0].name = "a\xc2\x9bm.jpg"; }},
  };
  for (const auto& [names, damage] : faults) {
    const TempDir folder;
    io::ColmapRecords records = SmallModel();
    damage(&records);
    WriteBinary(records, folder.path());
    ExpectError(folder.path(), io::ExitCode::kBadState, names);
  }
  EXPECT_EQ(faults.size(), 27u);
}

TEST(ColmapModelFaults, CountsAreCheckedBeforeAllocation) {
  for (const char* file : {"cameras.bin", "images.bin", "points3D.bin"}) {
    for (const std::uint64_t count : {std::uint64_t{1000}, std::uint64_t{1} << 60, std::uint64_t{1} << 62}) {
      const TempDir folder;
      WriteBinary(SmallModel(), folder.path());
      std::string bytes = io::ReadFile(folder.path() / file);
      std::memcpy(bytes.data(), &count, sizeof count);
      WriteText(folder.path() / file, bytes);
      ExpectError(folder.path(), io::ExitCode::kBadState, {file});
    }
  }
}

TEST(ColmapModelFaults, TruncatedAndPaddedFilesAreRefusedAtEveryLength) {
  int cases = 0;
  for (const char* file : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const TempDir folder;
    WriteBinary(SmallModel(), folder.path());
    const std::string bytes = io::ReadFile(folder.path() / file);
    for (std::size_t size = 0; size < bytes.size(); ++size, ++cases) {
      WriteText(folder.path() / file, bytes.substr(0, size));
      EXPECT_THROW(io::ReadColmapModel(folder.path()), io::Error) << file << " cut to " << size;
    }
    WriteText(folder.path() / file, bytes + "x");
    ExpectError(folder.path(), io::ExitCode::kBadState, {file, "1 bytes after"});
  }
  EXPECT_GT(cases, 700);
}

TEST(ColmapModelFaults, UnsupportedAndUndefinedCameraModels) {
  const TempDir folder;
  io::ColmapRecords records = SmallModel();
  records.cameras[1].model = "OPENCV_FISHEYE";
  WriteBinary(records, folder.path());
  ExpectError(folder.path(), io::ExitCode::kBadInput, {"camera 3", "OPENCV_FISHEYE", "Undistort first"});
  std::string bytes = io::ReadFile(folder.path() / "cameras.bin");
  bytes[12] = 99;
  WriteText(folder.path() / "cameras.bin", bytes);
  ExpectError(folder.path(), io::ExitCode::kBadState, {"camera 7", "undefined", "99"});
}

TEST(ColmapModelFaults, TextFaults) {
  const TempDir folder;
  WriteText(SmallModel(), folder.path());
  const std::string cameras = io::ReadFile(folder.path() / "cameras.txt");
  WriteText(folder.path() / "cameras.txt", cameras + "8 SIMPLE_RADIAL 640 480 500 320 240\n");
  ExpectError(folder.path(), io::ExitCode::kBadState, {"camera 8", "3 parameters", "SIMPLE_RADIAL needs 4"});
  WriteText(folder.path() / "cameras.txt", cameras + "8 MAGIC 640 480 500\n");
  ExpectError(folder.path(), io::ExitCode::kBadState, {"camera 8", "undefined", "'MAGIC'"});
  WriteText(folder.path() / "cameras.txt", cameras + "8 PINHOLE -640 480 500 500 320 240\n");
  ExpectError(folder.path(), io::ExitCode::kBadState, {"cameras.txt", "line 4", "'-640'", "not a number"});
  WriteText(folder.path() / "cameras.txt", cameras + "8 PINHOLE 640\n");
  ExpectError(folder.path(), io::ExitCode::kBadState, {"cameras.txt", "line 4", "too early"});
}

TEST(ColmapModelFaults, DamagedBytesNeverDoMoreThanThrow) {
  const TempDir folders[2];
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
    WriteText(file, bytes);
    try {
      const io::ColmapModel model = io::ReadColmapModel(folder);
      for (const io::Frame& frame : model.scene.frames) {
        EXPECT_TRUE(frame.world_from_cam.translation.allFinite());
      }
      ++parsed;
    } catch (const io::Error&) {
      ++refused;
    }
    WriteText(file, intact);
  }
  EXPECT_EQ(parsed + refused, 3000);
  EXPECT_GT(parsed, 100);
  EXPECT_GT(refused, 1000);
}

}  // namespace
