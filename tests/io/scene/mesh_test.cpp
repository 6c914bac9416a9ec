// Meshes in files, as a foreign reader (assimp) and a byte-wise look at them find them.
#include "io/scene/mesh.h"
#include "io/base/json.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <regex>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/require_program.h"

namespace {

using Eigen::Vector3f;

// A square pyramid without its base, which no symmetry hides: 5 vertices, 4 triangles.
io::Mesh Pyramid() {
  io::Mesh mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {2, 3, 0}, {0, 3, 0}, {1, 1, 5}};
  for (const Vector3f& position : mesh.positions)
    mesh.normals.push_back((position - Vector3f(1, 1, 1)).normalized());
  mesh.colours = {{0, 10, 255}, {128, 20, 3}, {188, 0, 77}, {1, 2, 3}, {250, 251, 252}};
  mesh.triangles = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  return mesh;
}

io::ProcessReport RunAssimp(std::vector<std::string> arguments, const std::filesystem::path& log) {
  arguments.insert(arguments.begin(), io::FindProgram("assimp")->string());
  return io::RunProcess(arguments, {.timeout_s = 60, .log_path = log});
}

// What `assimp info` says of a file.
std::string AssimpInfo(const std::filesystem::path& file) {
  const std::filesystem::path log = file.string() + ".log";
  EXPECT_TRUE(RunAssimp({"info", file}, log).Ok()) << ReadText(log);
  return ReadText(log);
}

void ExpectInfo(const std::string& info, const std::string& what, const std::string& value) {
  EXPECT_TRUE(std::regex_search(info, std::regex(what + ":\\s+" + value + "\\s"))) << what << "\n" << info;
}

TEST(MeshFiles, AForeignReaderFindsAllVerticesAndTriangles) {
  REQUIRE_PROGRAM("assimp");
  const TempDir dir;
  io::WriteMeshPly(dir / "a.ply", Pyramid());
  io::WriteMeshGlb(dir / "a.glb", Pyramid());
  for (const char* name : {"a.ply", "a.glb"}) {
    const std::string info = AssimpInfo(dir / name);
    ExpectInfo(info, "Meshes", "1");
    ExpectInfo(info, "Vertices", "5");
    ExpectInfo(info, "Faces", "4");
    // What assimp writes of what it read.
    const std::filesystem::path again = dir / (std::string(name) + "-again.ply");
    EXPECT_TRUE(RunAssimp({"export", dir / name, again}, dir / "export.log").Ok());
    EXPECT_NE(ReadText(again).find("property float nx"), std::string::npos) << name;
    EXPECT_NE(ReadText(again).find("property uchar red"), std::string::npos) << name;
  }
  const std::string ply = AssimpInfo(dir / "a.ply"), glb = AssimpInfo(dir / "a.glb");
  const auto corner = [](const std::string& info, const std::string& which) {
    std::smatch match;
    EXPECT_TRUE(std::regex_search(
        info,
        match,
        std::regex(which + "\\s+point\\s+\\(([-.0-9]+) ([-.0-9]+) ([-.0-9]+)\\)", std::regex::icase)))
        << info;
    return match.size() == 4 ? Vector3f(std::stof(match[1]), std::stof(match[2]), std::stof(match[3]))
                             : Vector3f(Vector3f::Zero());
  };
  EXPECT_EQ(corner(ply, "Minimum"), Vector3f(0, 0, 0));
  EXPECT_EQ(corner(ply, "Maximum"), Vector3f(2, 3, 5));
  EXPECT_EQ(corner(glb, "Minimum"), Vector3f(0, 0, -3));  // what was up, z, is y; y points backwards
  EXPECT_EQ(corner(glb, "Maximum"), Vector3f(2, 5, 0));
}

// The JSON of a glb file and the bytes of its buffer.
struct Glb {
  io::Json json;
  std::string bytes;

  template <typename T>
  T Number(int accessor, std::size_t index) const {
    const std::size_t view = json["accessors"][static_cast<std::size_t>(accessor)]["bufferView"];
    const std::size_t offset = json["bufferViews"][view].value("byteOffset", std::size_t{0});
    T value;
    std::memcpy(&value, bytes.data() + offset + index * sizeof(T), sizeof value);
    return value;
  }
};

Glb ReadGlb(const std::filesystem::path& path) {
  const std::string file = io::ReadFile(path);
  std::uint32_t header[5];
  std::memcpy(header, file.data(), sizeof header);
  EXPECT_EQ(header[2], file.size());
  return {io::ParseJson(file.substr(20, header[3])), file.substr(20 + header[3] + 8)};
}

TEST(MeshFiles, GlbHasLinearColoursAndNormalsOfItsOwnAxes) {
  const TempDir dir;
  const io::Mesh mesh = Pyramid();
  io::WriteMeshGlb(dir / "a.glb", mesh);
  const Glb glb = ReadGlb(dir / "a.glb");
  const io::Json& primitive = glb.json["meshes"][0]["primitives"][0];
  const int colour = primitive["attributes"]["COLOR_0"], normal = primitive["attributes"]["NORMAL"];
  EXPECT_EQ(glb.json["accessors"][static_cast<std::size_t>(colour)]["normalized"], true);
  for (std::size_t i = 0; i < mesh.colours.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double s = mesh.colours[i][c] / 255.0;
      const double linear = s < 0.0405 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
      EXPECT_NEAR(glb.Number<std::uint16_t>(colour, 4 * i + c) / 65535.0, linear, 1e-5);
    }
    EXPECT_EQ(glb.Number<std::uint16_t>(colour, 4 * i + 3), 65535);
    EXPECT_EQ(glb.Number<float>(normal, 3 * i), mesh.normals[i].x());
    EXPECT_EQ(glb.Number<float>(normal, 3 * i + 1), mesh.normals[i].z());
    EXPECT_EQ(glb.Number<float>(normal, 3 * i + 2), -mesh.normals[i].y());
  }
  EXPECT_TRUE(glb.json["materials"][0]["extensions"].contains("KHR_materials_unlit"));
  EXPECT_EQ(glb.json["extensionsUsed"], io::Json({"KHR_materials_unlit"}));
}

TEST(MeshFiles, PlyHoldsTheNumbersOfTheMesh) {
  const TempDir dir;
  const io::Mesh mesh = Pyramid();
  io::WriteMeshPly(dir / "a.ply", mesh);
  const std::string file = io::ReadFile(dir / "a.ply"), end = "end_header\n";
  const std::size_t vertices = file.find(end) + end.size(), faces = vertices + 5 * 27;
  ASSERT_EQ(file.size(), faces + 4 * 13);
  for (std::size_t i = 0; i < 5; ++i) {
    const char* at = file.data() + vertices + 27 * i;
    EXPECT_EQ(std::memcmp(at, mesh.positions[i].data(), 12), 0);
    EXPECT_EQ(std::memcmp(at + 12, mesh.normals[i].data(), 12), 0);
    EXPECT_EQ(std::memcmp(at + 24, mesh.colours[i].data(), 3), 0);
  }
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(file[faces + 13 * i], 3);
    EXPECT_EQ(std::memcmp(file.data() + faces + 13 * i + 1, mesh.triangles[i].data(), 12), 0);
  }
}

TEST(MeshFiles, RefuseWhatNoReaderWouldTake) {
  const TempDir dir;
  const auto expect_refused = [&](const io::Mesh& mesh) {
    EXPECT_ERROR(io::WriteMeshPly(dir / "a.ply", mesh), io::ExitCode::kInternal, "mesh");
    EXPECT_ERROR(io::WriteMeshGlb(dir / "a.glb", mesh), io::ExitCode::kInternal, "mesh");
    EXPECT_EQ(CountEntries(dir.path()), 0);
  };
  io::Mesh mesh = Pyramid();
  mesh.triangles[2][1] = 5;
  expect_refused(mesh);
  mesh = Pyramid(), mesh.positions[1].y() = std::numeric_limits<float>::quiet_NaN();
  expect_refused(mesh);
  mesh = Pyramid(), mesh.normals[1].y() = std::numeric_limits<float>::infinity();
  expect_refused(mesh);
  mesh = Pyramid(), mesh.colours.pop_back();
  expect_refused(mesh);
  mesh = Pyramid(), mesh.normals.pop_back();
  expect_refused(mesh);
}

TEST(TransformedMesh, MovesPointsAndTurnsNormals) {
  io::Sim3d target_from_source;
  target_from_source.scale = 2;
  target_from_source.rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  target_from_source.translation = {10, 20, 30};
  const io::Mesh mesh = Pyramid(), moved = io::TransformedMesh(target_from_source, mesh);
  EXPECT_EQ(moved.positions[2], Vector3f(4, 24, 30));
  for (std::size_t i = 0; i < mesh.normals.size(); ++i)
    EXPECT_EQ(moved.normals[i], Vector3f(-mesh.normals[i].y(), mesh.normals[i].x(), mesh.normals[i].z()));
  EXPECT_EQ(moved.triangles, mesh.triangles);
  EXPECT_EQ(moved.colours, mesh.colours);
}

}  // namespace
