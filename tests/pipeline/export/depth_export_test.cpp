// Depth, normals and support as files, read back with OpenCV.
#include "pipeline/export/depth_export.h"
#include "io/base/json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/support/files/sphere_export.h"

namespace pipeline {
namespace {

cv::Mat Read(const std::filesystem::path& path) { return cv::imread(path.string(), cv::IMREAD_UNCHANGED); }

TEST(DepthExport, TheFilesSayWhereTheSphereIs) {
  const TempDir dir;
  const ExportedScene scene = tests::SphereExport(dir / "scene", {.points_apart = "0,0,0,0,0,1=0.25"});
  ExportDepth(scene, dir / "depth");
  const auto json = io::ParseJson(ReadText(dir / "depth/depth.json"));
  EXPECT_EQ(json["unit"], "metre");
  EXPECT_EQ(json["invalid"], 0);
  ASSERT_EQ(json["frames"].size(), 20u);
  const double scale = json["scale"];
  EXPECT_LT(scale, 0.25 * 6 / 60000);
  EXPECT_NEAR(json["near"].get<double>(), 0.25 * 3, 0.01);
  double far = 0;
  int n_test = 0;
  const std::vector<ExportedView> views = ViewsOf(scene);
  for (std::size_t k = 0; k < views.size(); ++k) {
    EXPECT_EQ(json["frames"][k]["name"], views[k].name);
    n_test += json["frames"][k]["split"] == "test";
    const cv::Mat depth = Read(dir / "depth/depth" / views[k].name),
                  normals = Read(dir / "depth/normals" / views[k].name),
                  support = Read(dir / "depth/support" / views[k].name);
    ASSERT_EQ(depth.type(), CV_16U);
    ASSERT_EQ(normals.type(), CV_8UC3);
    ASSERT_EQ(support.type(), CV_8U);
    ASSERT_EQ(depth.size(), cv::Size(96, 72));
    const io::Rigid3d& pose = views[k].frame->world_from_cam;
    int n = 0;
    for (int y = 0; y < 72; ++y) {
      for (int x = 0; x < 96; ++x) {
        if (depth.at<std::uint16_t>(y, x) == 0) {
          ASSERT_EQ(support.at<std::uint8_t>(y, x), 0);
          ASSERT_EQ(normals.at<cv::Vec3b>(y, x), cv::Vec3b(0, 0, 0));
          continue;
        }
        ++n;
        const double z = scale * depth.at<std::uint16_t>(y, x) / 0.25;  // along the axis, scene units
        far = std::max(far, 0.25 * z);
        const Eigen::Vector3d ray = *io::RayFromImg(*views[k].camera, {x + 0.5, y + 0.5});
        const Eigen::Vector3d in_cam = ray * (z / -ray.z()), point = pose * in_cam;
        ASSERT_NEAR(point.norm(), 1, 2e-3);
        if (-(pose.rotation * ray).dot(point) < 0.4) continue;
        const cv::Vec3b bgr = normals.at<cv::Vec3b>(y, x);
        const Eigen::Vector3d normal =
            Eigen::Vector3d(bgr[2], bgr[1], bgr[0]) / 127.5 - Eigen::Vector3d::Ones();
        ASSERT_GT((pose.rotation * normal).normalized().dot(point), std::cos(0.07));
        ASSERT_GE(support.at<std::uint8_t>(y, x), 3);
      }
    }
    EXPECT_GT(n, 600);
  }
  EXPECT_EQ(n_test, 4);
  EXPECT_NEAR(json["far"].get<double>(), far, scale);
  // A second export replaces the first, and both leave nothing else behind.
  ExportDepth(scene, dir / "depth");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(dir.path()), {}), 2);
}

}  // namespace
}  // namespace pipeline
