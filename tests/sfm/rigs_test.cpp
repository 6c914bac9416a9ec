// Views of panoramas are posed by those of their panorama that are.
#include "sfm/rigs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "sfm/second_look.h"
#include "tests/support/scenes/pose_difference.h"
#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

using Eigen::Vector3d;

constexpr int kPlaces = 5, kSides = 4;

// Posed views of panoramas, and the pictures they are.
struct PanoramaCapture {
  io::ColmapModel model;
  std::vector<sfm::Picture> pictures;
};

PanoramaCapture PanoramaWalk(double noise_px) {
  PanoramaCapture walk{.model = PanoramaModel(kPlaces, noise_px), .pictures = {}};
  for (std::size_t i = 0; i < walk.model.scene.frames.size(); ++i) {
    walk.pictures.push_back({.name = walk.model.scene.frames[i].image_path.string(),
                             .width = 640,
                             .height = 480,
                             .focal_px = 500,
                             .rig = std::to_string(i / kSides) + ".png",
                             .heading_deg = 90. * static_cast<double>(i % kSides)});
  }
  return walk;
}

// In the order of the truth.
io::Scene Sorted(const io::Scene& scene, const io::Scene& truth) {
  io::Scene sorted = scene;
  for (std::size_t i = 0; i < truth.frames.size(); ++i) {
    const auto at = std::find_if(scene.frames.begin(), scene.frames.end(), [&](const io::Frame& frame) {
      return frame.image_path == truth.frames[i].image_path;
    });
    EXPECT_NE(at, scene.frames.end());
    if (at != scene.frames.end()) sorted.frames[i] = *at;
  }
  return sorted;
}

// Of the views whose names end so, the one that observes most points.
std::size_t BusiestView(const io::ColmapModel& model, const std::string& ending) {
  std::vector<int> counts(model.scene.frames.size());
  for (const io::Observation& observation : model.observations) {
    const auto frame = static_cast<std::size_t>(observation.frame_index);
    counts[frame] += model.scene.frames[frame].image_path.string().ends_with(ending);
  }
  return static_cast<std::size_t>(std::max_element(counts.begin(), counts.end()) - counts.begin());
}

TEST(Rigs, AViewThatIsPosedPosesItsPanorama) {
  const PanoramaCapture truth = PanoramaWalk(0);
  io::ColmapModel model = sfm::WithoutFrames(
      PanoramaWalk(0.5).model, {"view1_0.png", "view2_0.png", "view0_1.png", "view3_2.png", "view0_4.png"});
  for (io::Camera& camera : model.scene.cameras) camera.fl_x = camera.fl_y = 505, camera.k1 = 0.01;
  // A wrong pose, of the view of its panorama with most points.
  const std::size_t wrong = BusiestView(model, "_3.png");
  io::Rigid3d& pose = model.scene.frames[wrong].world_from_cam;
  pose.rotation = pose.rotation * Eigen::AngleAxisd(0.1, Vector3d::UnitX());
  sfm::BundleUncertainty uncertainty;
  const sfm::RigReport report = sfm::JoinRigs(truth.pictures, "", &model, &uncertainty);
  EXPECT_EQ(report.n_rigs, kPlaces);
  EXPECT_EQ(report.n_added, 6);
  EXPECT_LT(report.rotation_deg, 1e-6) << "views that agreed before";
  EXPECT_EQ(model.scene.cameras.size(), 1u);
  ASSERT_EQ(model.scene.frames.size(), truth.model.scene.frames.size());
  const PoseDifference difference = Compare(Sorted(model.scene, truth.model.scene), truth.model.scene);
  EXPECT_LT(difference.rotation_deg, 0.25);  // the worst; a pixel is 0.11 degrees, the wrong pose was 5.7 off
  EXPECT_LT(difference.centre, 0.01);
  for (std::size_t i = 0; i < model.scene.frames.size(); ++i) {
    const io::Frame& frame = model.scene.frames[i];
    const io::Camera& camera = model.scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    EXPECT_EQ(camera.fl_x, 500) << "as it was cut out";
    EXPECT_EQ(camera.k1, 0);
    EXPECT_LT(uncertainty.poses[i].rotation_deg, 0.1);
    for (std::size_t k = 0; k < i; ++k) {
      const bool is_one_panorama =
          model.scene.frames[k].world_from_cam.translation == frame.world_from_cam.translation;
      if (is_one_panorama) {
        EXPECT_EQ(uncertainty.poses[k].rotation_deg, uncertainty.poses[i].rotation_deg);
      }
    }
  }
}

TEST(Rigs, PicturesByThemselvesStayAsTheyAre) {
  PanoramaCapture walk = PanoramaWalk(0.5);
  for (sfm::Picture& picture : walk.pictures) picture.rig.clear();
  const io::ColmapModel before = walk.model;
  sfm::BundleUncertainty uncertainty;
  EXPECT_EQ(sfm::JoinRigs(walk.pictures, "", &walk.model, &uncertainty).n_rigs, 0);
  for (std::size_t i = 0; i < before.scene.frames.size(); ++i)
    EXPECT_EQ(walk.model.scene.frames[i].world_from_cam.translation,
              before.scene.frames[i].world_from_cam.translation);
}

TEST(Rigs, PicturesArePosedByOthersOfTheirPanorama) {
  std::vector<sfm::Picture> pictures = PanoramaWalk(0).pictures;
  pictures.push_back({.name = "photo.png", .width = 640, .height = 480});
  EXPECT_EQ(sfm::PosedWithRigs(pictures, {}), 0);
  EXPECT_EQ(sfm::PosedWithRigs(pictures, {"view1_2.png"}), kSides);
  EXPECT_EQ(sfm::PosedWithRigs(pictures, {"view1_2.png", "view3_2.png", "photo.png"}), kSides + 1);
}

}  // namespace
