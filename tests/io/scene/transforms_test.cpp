// transforms.json: every dialect is read, and every fault of a file is named.
#include "io/scene/transforms.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <cmath>
#include <fstream>
#include <random>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/image/image.h"
#include "io/scene/ply.h"
#include "tests/support/files/transforms_folder.h"

namespace {

namespace fs = std::filesystem;

const char* const kIdentity = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";

class Transforms : public TransformsFolder {
 protected:
  io::TransformsFile ReadText(const std::string& text) {
    fs::remove(json_);  // ext4 flushes a file that is truncated and written again: 5 ms each
    std::ofstream(json_, std::ios::binary) << text;
    return io::ReadTransforms(json_);
  }
  // The message of the error; empty when the text is accepted.
  std::string Refusal(const std::string& text) {
    try {
      ReadText(text);
      return "";
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), io::ExitCode::kBadInput);
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
  }
};

std::string Frame(const std::string& file,
                  const std::string& extra = "",
                  const std::string& matrix = kIdentity) {
  return R"({"file_path": ")" + file + R"(", "transform_matrix": )" + matrix + extra + "}";
}

// Two good frames under the given top-level text.
std::string File(const std::string& top, const std::string& extra_a = "", const std::string& extra_b = "") {
  return "{" + top + (top.empty() ? "" : ", ") + R"("frames": [)" + Frame("images/a.png", extra_a) + "," +
         Frame("images/b.png", extra_b) + "]}";
}

std::string FileWithMatrix(const std::string& matrix) {
  return R"({"fl_x": 10, "frames": [)" + Frame("images/a.png", "", matrix) + "," + Frame("images/b.png") +
         "]}";
}

TEST_F(Transforms, EveryDialectNamesMasksAndTheirFaults) {
  io::WriteImage(folder_ / "masks/b.png", io::MakeImage(kWidth, kHeight, 3));
  io::WriteImage(folder_ / "masks/turned.png", io::MakeImage(kHeight, kWidth, 3));
  for (const char* top :
       {"\"camera_angle_x\": 0.8", "\"fl_x\": 10", "\"fl_x\": 10, \"camera_model\": \"OPENCV\""}) {
    const io::TransformsFile file = ReadText(File(top, "", R"(, "mask_path": "masks/b.png")"));
    EXPECT_EQ(file.scene.frames.at(0).mask_path, "") << top;
    EXPECT_EQ(file.scene.frames.at(1).mask_path, folder_ / "masks/b.png") << top;
  }
  const auto refusal = [&](const std::string& path) {
    return Refusal(File("\"fl_x\": 10", R"(, "mask_path": ")" + path + "\""));
  };
  for (const auto& [path, why] : {std::pair{"masks/gone.png", "does not exist"},
                                  {"masks/turned.png", "differs in size"},
                                  {"../b.png", "leaves the folder"}}) {
    const std::string named = "frames[0].mask_path: \"" + std::string(path) + "\" " + why;
    EXPECT_NE(refusal(path).find(named), std::string::npos) << refusal(path);
  }
}

TEST_F(Transforms, BlenderDialectTakesSizeAndFocalFromThePicture) {
  const auto file =
      ReadText(R"({"camera_angle_x": 0.8, "frames": [{"rotation": 0.1, "file_path": "./images/a", )"
               R"("transform_matrix": )" +
               std::string(kIdentity) + "}," + Frame("images/c") + "]}");
  EXPECT_EQ(file.dialect, io::TransformsDialect::kBlender);
  ASSERT_EQ(file.scene.frames.size(), 2u);
  EXPECT_EQ(file.scene.frames[0].image_path, folder_ / "images/a.png");
  EXPECT_EQ(file.scene.frames[1].image_path, folder_ / "images/c.jpg");
  const io::Camera& camera = file.scene.cameras.at(0);
  EXPECT_EQ(camera.width, kWidth);
  EXPECT_NEAR(camera.fl_x, 0.5 * kWidth / std::tan(0.4), 1e-12);
  EXPECT_EQ(camera.fl_y, camera.fl_x);
  EXPECT_EQ(camera.cx, kWidth / 2.0);
  EXPECT_TRUE(file.notes.empty());
}

TEST_F(Transforms, InstantNgpDialectKeepsDistortionAndNamesMissingPictures) {
  const auto file =
      ReadText(R"({"fl_x": 10, "fl_y": 11, "k1": 0.05, "p2": -1e-3, "w": 8.0, "h": 6.0, "aabb_scale": 4,)"
               R"("is_fisheye": false, "frames": [)" +
               Frame("images\\\\a.png") + "," + Frame("images/b.png", ", \"sharpness\": 3") + "," +
               Frame("images/gone.jpg") + "]}");
  EXPECT_EQ(file.dialect, io::TransformsDialect::kInstantNgp);
  EXPECT_EQ(file.missing_images, std::vector<std::string>{"images/gone.jpg"});
  ASSERT_EQ(file.scene.frames.size(), 2u);
  EXPECT_EQ(file.scene.cameras.at(0).k1, 0.05);
  EXPECT_EQ(file.scene.cameras.at(0).p2, -1e-3);
  EXPECT_NE(
      Refusal(R"({"fl_x": 10, "frames": [)" + Frame("images/a.png") + "," + Frame("images/x.png") + "]}")
          .find("do not exist, first images/x.png"),
      std::string::npos);
}

// Observers are frames of the file; in the scene they are counted without those whose picture is missing.
TEST_F(Transforms, ObserversOfPointsFollowTheFramesThatExist) {
  std::vector<io::Point3D> points(2);
  points[0].frame_indices = {0, 1, 2};
  points[1].frame_indices = {1};
  io::WritePly(folder_ / "points.ply", points);
  const std::string text = R"({"fl_x": 10, "w": 8, "h": 6, "ply_file_path": "points.ply", "frames": [)";
  const std::string frames = Frame("images/a.png") + "," + Frame("images/gone.png") + ",";
  const auto file = ReadText(text + frames + Frame("images/b.png") + "]}");
  ASSERT_EQ(file.scene.points.size(), 1u);  // nobody is left who observes the other
  EXPECT_EQ(file.scene.points[0].frame_indices, (std::vector<int>{0, 1}));
  EXPECT_NE(Refusal(text + Frame("images/a.png") + "," + Frame("images/b.png") + "]}").find("frame 2"),
            std::string::npos);
}

TEST_F(Transforms, UnknownKeysAreNotedAndKnownForeignOnesAreSilent) {
  const auto file =
      ReadText(File(R"("fl_x": 10, "colour": 1, "sharpness_discard_threshold": 0)", R"(, "tag": [1])"));
  EXPECT_EQ(file.notes,
            (std::vector<std::string>{"ignored colour (unknown)", "ignored frames[].tag (unknown)"}));
}

TEST_F(Transforms, OfManyUnknownKeysTenAreNamed) {
  std::string keys = R"("fl_x": 10)";
  for (int i = 0; i < 50000; ++i) keys += fmt::format(R"(, "unknown{:05}": 1)", i);
  const auto file = ReadText(File(keys));
  ASSERT_EQ(file.notes.size(), 11u);
  EXPECT_EQ(file.notes[9], "ignored unknown00009 (unknown)");
  EXPECT_EQ(file.notes[10], "ignored 49990 more keys");
}

TEST_F(Transforms, NoiseInRotationsIsRepairedAndMoreIsRefused) {
  const auto rotation = [&](const char* m00) {
    return FileWithMatrix(std::string("[[") + m00 + ",0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]");
  };
  for (const char* m00 : {"1.0000006", "1.0002"}) {
    const Eigen::Matrix3d r = ReadText(rotation(m00)).scene.frames[0].world_from_cam.rotation;
    EXPECT_NEAR((r.transpose() * r - Eigen::Matrix3d::Identity()).norm(), 0, 1e-14);
  }
  EXPECT_TRUE(ReadText(rotation("1.0000006")).notes.empty());
  EXPECT_EQ(ReadText(rotation("1.0002")).notes.size(), 1u);
  EXPECT_NE(Refusal(rotation("1.001")), "");
}

TEST_F(Transforms, RefusesMatricesThatAreNoPose) {
  for (const char* matrix : {"[[1,0,0],[0,1,0],[0,0,1]]",
                             "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1],[0,0,0,1]]",
                             "[[1,0,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
                             "[[1,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
                             "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]",
                             "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,1,1]]",
                             "[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
                             "[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]",
                             "[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]",
                             "[[1,0,0,null],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
                             "[[1,0,0,\"0\"],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
                             "[[1,0,0,1e30],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
                             "7"}) {
    EXPECT_NE(Refusal(FileWithMatrix(matrix)).find("frames[0].transform_matrix"), std::string::npos)
        << matrix;
  }
  const std::string rows3 = "[[1,0,0,4],[0,1,0,0],[0,0,1,0]]";
  EXPECT_EQ(ReadText(FileWithMatrix(rows3)).scene.frames[0].world_from_cam.translation.x(), 4);
  EXPECT_NE(Refusal(R"({"camera_model": "OPENCV", "fl_x": 10, "frames": [)" +
                    Frame("images/a.png", "", rows3) + "]}"),
            "");
}

TEST_F(Transforms, RefusesWrongTypesRangesAndContradictions) {
  const struct {
    const char *top, *frame, *named, *why;
  } kCases[] = {
      {"\"w\": 800.7, \"fl_x\": 10", "", "w: 800.7", "whole number"},
      {"\"w\": -5, \"fl_x\": 10", "", "w: -5", "outside"},
      {"\"w\": 1e30, \"fl_x\": 10", "", "w: 1e+30", "outside"},
      {"\"w\": \"8\", \"fl_x\": 10", "", ": w: ", "not a number"},
      {"\"w\": 9, \"fl_x\": 10", "", ": w: ", "a.png, which has 8"},
      {"\"fl_x\": null", "", ": fl_x: ", "is null"},
      {"\"fl_x\": 0", "", "fl_x: 0", "outside"},
      {"\"fl_x\": true", "", ": fl_x: ", "not a number"},
      {"\"cx\": 4", "", "frames[0]: ", "states no fl_x"},
      {"\"fl_x\": 10, \"cx\": 0", "", "frames[0]: ", "principal point (0, 3) on the edge"},
      {"\"fl_x\": 10, \"cx\": -5", "", "frames[0]: ", "principal point (-5, 3) on the edge"},
      {"\"fl_x\": 10, \"cy\": 1e-320", "", "frames[0]: ", "principal point"},
      {"\"fl_x\": 10, \"cy\": 6", "", "frames[0]: ", "principal point (4, 6) on the edge"},
      {"\"fl_x\": 300", "", "frames[0]: ", "focal length of 300 pixels for pictures of 8x6"},
      {"\"fl_x\": 1", ", \"fl_y\": 0.5", "fl_y: 0.5", "outside"},
      {"\"camera_angle_x\": 0.0001", "", "frames[0]: ", "focal length of 80000 pixels"},
      {"\"fl_x\": 10, \"camera_angle_x\": 0.765", "", "frames[0]: ", "contradicts camera_angle_x"},
      {"\"fl_x\": 10, \"x_fov\": 50", "", "frames[0]: ", "contradicts x_fov"},
      {"\"fl_x\": 10", ", \"fl_x\": 10.1", "frames[0].fl_x: ", "on the top level"},
      {"\"fl_x\": 10, \"is_fisheye\": true", "", "is_fisheye: ", "Undistort first"},
      {"\"fl_x\": 10, \"camera_model\": \"OPENCV_FISHEYE\"",
       "",
       "camera_model: \"OPENCV_FISHEYE\"",
       "Undistort first"},
      {"\"fl_x\": 10, \"k3\": 0.1", "", "k3", "Undistort first"},
      {"\"fl_x\": 10", ", \"k4\": 0.1", "k4", "Undistort first"},
      {"\"fl_x\": 10", ", \"transform_matrix_start\": [1]", "transform_matrix_start", "not supported"},
      {"\"fl_x\": 10, \"ply_file_path\": \"gone.ply\"", "", "ply_file_path: ", "does not exist"},
      {"\"fl_x\": 10, \"pipeline\": {\"near\": 6, \"far\": 2}", "", "pipeline: near", "not smaller"},
      {"\"fl_x\": 10, \"pipeline\": 7", "", ": pipeline: ", "not an object"},
      {"\"fl_x\": 10, \"pipeline\": {\"near\": 2, \"far\": 6, \"aabb\": [[0, 0, 1], [1, 1, 1]]}",
       "",
       "aabb: ",
       "has no volume"},
      {"\"fl_x\": 10, \"pipeline\": {\"near\": 2, \"far\": 6, \"aabb\": [[0, 0], [1, 1, 1]]}",
       "",
       "aabb[0]",
       "2 elements instead of 3"},
  };
  for (const auto& c : kCases) {
    const std::string refusal = Refusal(File(c.top, c.frame));
    for (const char* part : {c.named, c.why})
      EXPECT_NE(refusal.find(part), std::string::npos) << c.top << c.frame << " gave: " << refusal;
  }
  EXPECT_EQ(Refusal(File("\"fl_x\": 10", ", \"fl_x\": 10, \"k1\": 0.1", ", \"k1\": 0.2")), "");
  EXPECT_EQ(Refusal(File("\"fl_x\": 10, \"camera_angle_x\": 0.761012")), "");
}

TEST_F(Transforms, RefusesMissingParts) {
  EXPECT_NE(Refusal("{}").find("\"frames\" is missing"), std::string::npos);
  EXPECT_NE(Refusal("[]").find("is not an object"), std::string::npos);
  EXPECT_NE(Refusal(R"({"frames": []})").find(": frames: is empty"), std::string::npos);
  EXPECT_NE(Refusal(R"({"frames": {}})").find(": frames: is not an array"), std::string::npos);
  EXPECT_NE(Refusal(R"({"fl_x": 9, "frames": [{"file_path": "images/a.png"}]})")
                .find("frames[0]: \"transform_matrix\" is missing"),
            std::string::npos);
  EXPECT_NE(Refusal(R"({"fl_x": 9, "frames": [{"transform_matrix": )" + std::string(kIdentity) + "}]}")
                .find("frames[0]: \"file_path\" is missing"),
            std::string::npos);
}

TEST_F(Transforms, PicturesStayBelowTheFolderAndAreNamedOnce) {
  const fs::path outside = folder_.string() + "_outside.png";
  io::WriteImage(outside, io::MakeImage(kWidth, kHeight, 3));
  fs::create_symlink(outside, folder_ / "link.png");
  fs::create_symlink("a.png", folder_ / "images/same.png");
  fs::create_symlink("/dev/zero", folder_ / "zero");
  const auto with = [&](const std::string& path) {
    return Refusal(R"({"fl_x": 9, "frames": [)" + Frame("images/a.png") + "," + Frame(path) + "," +
                   Frame("images/b.png") + "]}");
  };
  EXPECT_EQ(with("images/../images/c.jpg"), "");
  for (const std::string& path : {outside.string(),
                                  "../" + outside.filename().string(),
                                  std::string("../../../../etc/passwd"),
                                  std::string("..\\\\x.png"),
                                  std::string("C:\\\\x.png"),
                                  std::string("http://example.org/x.png"),
                                  std::string("link.png"),
                                  std::string("zero"),
                                  std::string("a\\u0000.png"),
                                  std::string(""),
                                  std::string("images/a.png"),
                                  std::string("images/same.png")}) {
    EXPECT_NE(with(path).find("frames[1].file_path"), std::string::npos) << path << " gave: " << with(path);
  }
  std::ofstream(folder_ / "text.jpg") << "no picture at all, but long enough to hold a header";
  EXPECT_NE(with("text.jpg"), "");
  ASSERT_EQ(mkfifo((folder_ / "pipe.png").c_str(), 0600), 0);
  EXPECT_NE(with("pipe.png").find("not a regular file"), std::string::npos);
  fs::remove(outside);
}

TEST_F(Transforms, DamagedFilesAreReadOrRefusedButNeverMore) {
  io::Scene scene = AwkwardScene(folder_);
  scene.aabb = {{-1, -1, -1}, {1, 1, 1}};
  io::WriteTransforms(json_, scene, "");
  const std::string good = io::ReadFile(json_);
  std::mt19937 random(7);
  int refused = 0;
  constexpr int kRounds = 4000;
  for (int i = 0; i < kRounds; ++i) {
    std::string text = good;
    for (std::size_t flips = 1 + random() % 3; flips > 0; --flips) {
      const std::size_t at = random() % text.size(), length = 1 + random() % 20;
      switch (random() % 4) {
        case 0:
          text[at] = static_cast<char>(random());
          break;
        case 1:
          text[at] = "{}[],:\"0-.eE"[random() % 12];
          break;
        case 2:
          text.erase(at, length);
          break;
        default:
          text.insert(at, text.substr(random() % text.size(), length));
      }
    }
    try {
      const io::TransformsFile file = ReadText(text);
      for (const io::Frame& frame : file.scene.frames) {
        ASSERT_TRUE(frame.world_from_cam.translation.allFinite());
        ASSERT_NEAR(frame.world_from_cam.rotation.determinant(), 1, 1e-9);
      }
    } catch (const io::Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, kRounds / 2);
  EXPECT_LT(refused, kRounds);
}

}  // namespace
