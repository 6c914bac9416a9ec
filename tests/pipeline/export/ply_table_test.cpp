// The bytes of a table of vertices.
#include "pipeline/export/ply_table.h"

#include <gtest/gtest.h>

#include "tests/support/files/sphere_export.h"

namespace pipeline {
namespace {

TEST(PlyTable, HoldsEveryColumnInItsType) {
  const TempDir dir;
  std::vector<PlyColumn> columns;
  AddVectorColumns(
      "n", [](std::size_t i) { return Eigen::Vector3d(0.5, 1, static_cast<double>(i)); }, &columns);
  columns.push_back({"byte", PlyType::kUchar, [](std::size_t i) { return i == 0 ? 254.6 : 300.0; }});
  columns.push_back({"word", PlyType::kUshort, [](std::size_t i) { return i == 0 ? -3.0 : 1e6; }});
  WritePlyTable(dir / "a.ply", {}, 2, columns);
  const std::string head =
      "ply\nformat binary_little_endian 1.0\ncomment written by pipeline export\ncomment frame scene, unit: "
      "scene unit\nelement vertex 2\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar "
      "byte\nproperty ushort word\nend_header\n";
  EXPECT_EQ(ReadText(dir / "a.ply").substr(0, head.size()), head);
  auto read = tests::PlyColumns(dir / "a.ply");
  EXPECT_EQ(read["nx"], (std::vector<double>{0.5, 0.5}));
  EXPECT_EQ(read["nz"], (std::vector<double>{0, 1}));
  EXPECT_EQ(read["byte"], (std::vector<double>{255, 255}));
  EXPECT_EQ(read["word"], (std::vector<double>{0, 65535}));
}

}  // namespace
}  // namespace pipeline
