// The file of splats shows, in its own frame, what the splats show in the scene's.
#include "pipeline/export/splats_export.h"

#include <gtest/gtest.h>

#include "nerf/splatting/plain_rasteriser.h"
#include "tests/support/files/splat_file.h"
#include "tests/support/scenes/some_splats.h"

namespace pipeline {
namespace {

TEST(SplatsExport, LooksTheSameInAnotherFrame) {
  const TempDir dir;
  const io::Sim3d scene_from_sfm{
      0.4, Eigen::AngleAxisd(1, Eigen::Vector3d(1, 2, 2) / 3).toRotationMatrix(), {1, 2, 3}};
  const TargetFrame target = MakeTargetFrame({.frame = "sfm"}, scene_from_sfm);
  const nerf::Splats splats = tests::SomeSplats(300);
  WriteSplats(splats, target, dir / "splats.ply");
  const nerf::Splats read = tests::SplatsOfFile(dir / "splats.ply");
  ASSERT_EQ(read.size(), splats.size());
  nerf::SplatView view = tests::SomeView(60, 40);
  const std::vector<double> want = RenderPlainly(splats, view, {0, 0, 0});
  view.world_from_cam = io::TransformPose(target.target_from_scene, view.world_from_cam);
  const std::vector<double> got = RenderPlainly(read, view, {0, 0, 0});
  double most = 0, sum = 0;
  for (std::size_t i = 0; i < want.size(); ++i)
    most = std::max(most, std::abs(want[i] - got[i])), sum += want[i];
  EXPECT_LT(most, 1.5 / 255);  // of splats that pass the threshold of 1 / 255 in one of them alone
  EXPECT_GT(sum / static_cast<double>(want.size()), 0.2);
}

TEST(SplatsExport, HasThePropertiesOfTheReferenceInTheirOrder) {
  const TempDir dir;
  WriteSplats(tests::SomeSplats(2), {}, dir / "splats.ply");
  const std::string text = ReadText(dir / "splats.ply");
  std::istringstream lines(text.substr(0, text.find("end_header")));
  std::string names;
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("property float ")) names += line.substr(15) + " ";
  EXPECT_EQ(
      names,
      "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 f_rest_0 f_rest_1 f_rest_2 f_rest_3 f_rest_4 f_rest_5 f_rest_6 "
      "f_rest_7 f_rest_8 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 ");
  const auto columns = tests::PlyColumns(dir / "splats.ply");
  EXPECT_EQ(columns.at("nx")[0], 0);
  double square = 0;
  for (const char* part : {"rot_0", "rot_1", "rot_2", "rot_3"}) square += std::pow(columns.at(part)[1], 2);
  EXPECT_NEAR(square, 1, 1e-6);
}

}  // namespace
}  // namespace pipeline
