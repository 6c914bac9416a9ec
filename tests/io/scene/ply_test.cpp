// PLY: our layout round-trips, the layouts of other programs are read, lies about sizes are refused.
#include "io/scene/ply.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <random>

#include "io/base/atomic_file.h"
#include "io/base/error.h"

namespace {

namespace fs = std::filesystem;

class Ply : public testing::Test {
 protected:
  Ply() { fs::create_directories(folder_); }
  ~Ply() override { fs::remove_all(folder_); }

  std::vector<io::Point3D> ReadText(const std::string& bytes) {
    fs::remove(folder_ / "t.ply");  // ext4 flushes a file that is truncated and written again
    std::ofstream(folder_ / "t.ply", std::ios::binary) << bytes;
    return io::ReadPly(folder_ / "t.ply");
  }

  fs::path folder_ = fs::temp_directory_path() / ("io_ply_test_" + std::to_string(getpid()));
};

std::vector<io::Point3D> TwoPoints() {
  std::vector<io::Point3D> points(2);
  points[0].xyz = {1.5, -2.25, 1e6};
  points[0].rgb = {0, 128, 255};
  points[1].xyz = {-0.0, 3, 4};
  points[1].rgb = {1, 2, 3};
  return points;
}

TEST_F(Ply, RoundTripIsExactInSinglePrecision) {
  io::WritePly(folder_ / "a.ply", TwoPoints());
  const auto read = io::ReadPly(folder_ / "a.ply");
  ASSERT_EQ(read.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read[i].xyz, TwoPoints()[i].xyz);
    EXPECT_EQ(read[i].rgb, TwoPoints()[i].rgb);
  }
  EXPECT_EQ(fs::file_size(folder_ / "a.ply"),
            io::ReadFile(folder_ / "a.ply").find("end_header\n") + 11 + 2 * 15);
  io::WritePly(folder_ / "none.ply", {});
  EXPECT_TRUE(io::ReadPly(folder_ / "none.ply").empty());
}

TEST_F(Ply, ObserversAreKeptWhereTheyAreKnown) {
  std::vector<io::Point3D> points = TwoPoints();
  points[1].frame_indices = {0, 7};
  io::WritePly(folder_ / "a.ply", points);
  const auto read = io::ReadPly(folder_ / "a.ply");
  ASSERT_EQ(read.size(), 2u);
  EXPECT_TRUE(read[0].frame_indices.empty());
  EXPECT_EQ(read[1].frame_indices, points[1].frame_indices);
  // Other readers see a second element with properties of fixed size.
  EXPECT_NE(io::ReadFile(folder_ / "a.ply")
                .find("element observation 2\nproperty int vertex\nproperty int frame\n"),
            std::string::npos);
  for (const char* damage : {"element observation 3\n", "element observation x\n"}) {
    std::string bytes = io::ReadFile(folder_ / "a.ply");
    bytes.replace(bytes.find("element observation 2\n"), std::strlen(damage), damage);
    EXPECT_THROW(ReadText(bytes), io::Error) << damage;
  }
  std::string bytes = io::ReadFile(folder_ / "a.ply");
  bytes[bytes.size() - 8] = 2;  // a vertex beyond the last one
  EXPECT_THROW(ReadText(bytes), io::Error);
}

TEST_F(Ply, CutAnywhereIsRefused) {
  std::vector<io::Point3D> points = TwoPoints();
  for (const bool observed : {false, true}) {
    if (observed) points[1].frame_indices = {0, 7};
    io::WritePly(folder_ / "a.ply", points);
    const std::string good = io::ReadFile(folder_ / "a.ply");
    for (std::size_t size = 0; size < good.size(); ++size)
      EXPECT_THROW(ReadText(good.substr(0, size)), io::Error) << size << " of " << good.size();
  }
}

TEST_F(Ply, ReadsAsciiWithOtherPropertiesAndElements) {
  const auto points = ReadText(
      "ply\nformat ascii 1.0\ncomment x\nelement vertex 2\nproperty float nx\nproperty double x\n"
      "property float y\nproperty float z\nproperty uint8 red\nproperty uint8 green\nproperty uint8 blue\n"
      "element face 0\nproperty list uchar int vertex_indices\nend_header\n"
      "9 0.1 2 3 255 0 7\n9 -1e-3 5 6 1 2 3\n");
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].xyz, Eigen::Vector3d(0.1, 2, 3));
  EXPECT_EQ(points[0].rgb, (std::array<std::uint8_t, 3>{255, 0, 7}));
  EXPECT_EQ(points[1].xyz.x(), -1e-3);
}

TEST_F(Ply, ReadsBinaryDoublesWithoutColour) {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty double x\nproperty double y\n"
      "property double z\nproperty int id\nend_header\n";
  const double xyz[] = {0.1, 0.2, 0.3};
  bytes.append(reinterpret_cast<const char*>(xyz), sizeof xyz);
  bytes.append(4, '\x7f');
  EXPECT_EQ(ReadText(bytes).at(0).xyz, Eigen::Vector3d(0.1, 0.2, 0.3));
}

TEST_F(Ply, RefusesDamage) {
  const std::string head = "ply\nformat ascii 1.0\nelement vertex ";
  const std::string xyz = "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  const std::string green_blue = "\nproperty uchar green\nproperty uchar blue";
  EXPECT_EQ(ReadText(head + "1" + xyz + "1 2 3\n").size(), 1u);
  EXPECT_EQ(ReadText(head + "1\nproperty uchar red" + green_blue + xyz + "255 9 9 1 2 3\n").size(), 1u);
  for (const std::string& bad : {std::string(),
                                 std::string("ply\n"),
                                 head + "2" + xyz + "1 2 3\n",
                                 head + "18446744073709551615" + xyz + "1 2 3\n",
                                 head + "-1" + xyz + "1 2 3\n",
                                 head + "1" + xyz + "1 nan 3\n",
                                 head + "1" + xyz + "1 inf 3\n",
                                 head + "1" + xyz + "1 2e9 3\n",
                                 head + "1" + xyz + "1 two 3\n",
                                 head + "1\nproperty float x\nend_header\n1\n",
                                 head + "1\nproperty list uchar int x\nend_header\n1\n",
                                 "ply\nelement vertex 1" + xyz + "1 2 3 4 5 6 7\n",
                                 std::string("ply\nformat ascii 1.0") + xyz,
                                 "ply\nformat ascii 1.0\nelement face 0\nelement vertex 1" + xyz + "1 2 3\n",
                                 head + "1\nelement vertex 1" + xyz + "1 2 3\n",
                                 head + "1\nproperty float red" + green_blue + xyz + "9 9 9 1 2 3\n",
                                 head + "1\nproperty uchar red" + green_blue + xyz + "256 9 9 1 2 3\n",
                                 std::string("ply\nformat binary_big_endian 1.0\nelement vertex 0") + xyz}) {
    EXPECT_THROW(ReadText(bad), io::Error) << bad;
  }
  EXPECT_THROW(io::ReadPly(folder_ / "absent.ply"), io::Error);
}

TEST_F(Ply, DamagedBytesAreReadOrRefusedButNeverMore) {
  io::WritePly(folder_ / "a.ply", TwoPoints());
  const std::string good = io::ReadFile(folder_ / "a.ply");
  std::mt19937 random(1);
  int refused = 0;
  constexpr int kRounds = 3000;
  for (int i = 0; i < kRounds; ++i) {
    std::string bytes = good;
    const std::size_t at = random() % bytes.size();
    if (random() % 2)
      bytes[at] = static_cast<char>(random());
    else
      bytes.erase(at, 1 + random() % 8);
    try {
      EXPECT_LE(ReadText(bytes).size(), bytes.size());
    } catch (const io::Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, kRounds / 10);
  EXPECT_LT(refused, kRounds);
}

}  // namespace
