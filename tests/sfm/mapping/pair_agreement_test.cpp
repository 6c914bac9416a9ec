// Pairs made from a known scene agree with it; moved cameras contradict them.
#include "sfm/mapping/pair_agreement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace {

struct Capture {
  io::Scene scene;
  std::vector<std::string> names;
  std::vector<sfm::Features> features;
  std::vector<sfm::VerifiedPair> pairs;
};

// Cameras on a line that look at the same 100 points; every pair matches all of them, and `outliers` of the
// matches are exchanged with their neighbour. Every other picture has twice the focal length.
Capture Make(int outliers = 0, int n = 4) {
  Capture capture;
  io::Camera camera{.width = 800, .height = 600, .fl_x = 700, .fl_y = 700, .cx = 400, .cy = 300, .k1 = -0.05};
  capture.scene.cameras = {camera, camera};
  capture.scene.cameras[1].fl_x = capture.scene.cameras[1].fl_y = 1400;
  std::mt19937 random(5);
  const auto uniform = [&] { return random() / 4294967296.0 * 2 - 1; };
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 100; ++i) points.emplace_back(uniform(), 0.7 * uniform(), -6 + uniform());
  for (int i = 0; i < n; ++i) {
    io::Frame frame;
    frame.image_path = "p" + std::to_string(i);
    frame.camera_index = i % 2;
    frame.world_from_cam.translation = {0.6 * i - 0.9, 0.1 * i, 0};
    capture.scene.frames.push_back(frame);
    capture.names.push_back(frame.image_path.string());
    sfm::Features features;
    for (const Eigen::Vector3d& point : points) {
      const auto xy = io::ImgFromCam(capture.scene.cameras[static_cast<std::size_t>(i % 2)],
                                     frame.world_from_cam.Inverse() * point);
      features.keypoints.push_back({static_cast<float>(xy->x()), static_cast<float>(xy->y())});
    }
    capture.features.push_back(features);
  }
  for (std::size_t a = 0; a < capture.names.size(); ++a) {
    for (std::size_t b = a + 1; b < capture.names.size(); ++b) {
      sfm::VerifiedPair pair{capture.names[a], capture.names[b], 100};
      for (int k = 0; k < 100; ++k) pair.matches.push_back({k, k < outliers ? (k + 1) % outliers : k});
      capture.pairs.push_back(pair);
    }
  }
  return capture;
}

sfm::PairAgreement Compare(const Capture& c) {
  return sfm::CompareWithPairs(c.scene, c.names, c.features, c.pairs);
}

TEST(PairAgreement, TheTruthAgrees) {
  EXPECT_EQ(Compare(Make()).pairs, 6);
  EXPECT_EQ(Compare(Make()).contradicting, 0);
  EXPECT_EQ(Compare(Make(45)).contradicting, 0) << "most matches still agree";
  EXPECT_EQ(Compare(Make(60)).contradicting, 6);
  Capture turned = Make();
  for (io::Frame& frame : turned.scene.frames) {
    frame.world_from_cam =
        io::Rigid3d{Eigen::AngleAxisd(1, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
                    {5, 0, 0}} *
        frame.world_from_cam;
  }
  EXPECT_EQ(Compare(turned).contradicting, 0);
}

// Keypoints moved across the baseline in one of two pictures are off by the square root of 2 less, shared
// among both.
TEST(PairAgreement, EightPixelsAreTheLimit) {
  for (const auto& [shift, contradicting] : {std::pair{10.0f, 0}, {13.0f, 1}}) {
    for (const std::size_t of : {0u, 1u}) {
      Capture capture = Make(0, 2);
      capture.scene.frames[1].world_from_cam.translation.y() = 0;
      capture.scene.frames[1].camera_index = 0;
      capture.features[1] = capture.features[0];
      for (sfm::Keypoint& keypoint : capture.features[1].keypoints) keypoint.x -= 60;
      for (sfm::Keypoint& keypoint : capture.features[of].keypoints) keypoint.y += shift;
      EXPECT_EQ(Compare(capture).contradicting, contradicting) << shift << " " << of;
    }
  }
}

TEST(PairAgreement, TheWiderCameraSetsTheLimit) {
  for (const auto& [shift, contradicting] : {std::pair{10.0f, 0}, {13.0f, 1}}) {
    Capture capture = Make(0, 2);
    for (sfm::Keypoint& keypoint : capture.features[0].keypoints) keypoint.y += shift;
    EXPECT_EQ(Compare(capture).contradicting, contradicting) << shift;
  }
}

TEST(PairAgreement, AMisplacedCameraContradictsItsPairs) {
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d::UnitX().eval(), Eigen::Vector3d::UnitY().eval(), Eigen::Vector3d::UnitZ().eval()}) {
    Capture capture = Make();
    capture.scene.frames[3].world_from_cam.rotation = Eigen::AngleAxisd(0.2, axis).toRotationMatrix();
    const sfm::PairAgreement agreement = Compare(capture);
    EXPECT_EQ(agreement.contradicting, 3) << axis.transpose();
    EXPECT_DOUBLE_EQ(agreement.contradicting_share, 0.5);
  }
}

TEST(PairAgreement, RaysThatMeetBehindTheCamerasContradict) {
  Capture capture = Make();
  // Mirrored baselines keep every epipolar line and move every point behind the cameras.
  for (io::Frame& frame : capture.scene.frames) frame.world_from_cam.translation *= -1;
  EXPECT_EQ(Compare(capture).contradicting, 6);
}

// Turned about the baseline, a camera keeps its epipolar planes and looks away from the points.
TEST(PairAgreement, RaysThatMeetBehindOneCameraContradict) {
  Capture capture = Make(0, 2);
  io::Rigid3d& pose = capture.scene.frames[1].world_from_cam;
  const Eigen::Vector3d baseline = pose.translation - capture.scene.frames[0].world_from_cam.translation;
  pose.rotation = Eigen::AngleAxisd(EIGEN_PI, baseline.normalized()).toRotationMatrix();
  EXPECT_EQ(Compare(capture).contradicting, 1);
}

TEST(PairAgreement, ACameraThatOnlyTurnedAgrees) {
  Capture capture = Make();
  for (std::size_t i = 0; i < 4; ++i) {
    capture.scene.frames[i].world_from_cam.translation.setZero();
    capture.scene.frames[i].camera_index = 0;
    capture.features[i] = capture.features[0];
  }
  EXPECT_EQ(Compare(capture).contradicting, 0);
}

TEST(PairAgreement, StrongPairsCountMore) {
  Capture capture = Make();
  capture.scene.frames[3].world_from_cam.rotation =
      Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  for (sfm::VerifiedPair& pair : capture.pairs) {
    if (pair.name_b == "p3") pair.inliers = 25;
  }
  EXPECT_DOUBLE_EQ(Compare(capture).contradicting_share, 75.0 / 375);
}

// The last of six pictures contradicts all others; three of them are at most 3 apart, of 12 such pairs.
TEST(PairAgreement, FollowingPicturesAreCountedForThemselves) {
  Capture capture = Make(0, 6);
  capture.scene.frames[5].world_from_cam.rotation =
      Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  for (const bool reversed : {false, true}) {
    if (reversed) {
      std::reverse(capture.names.begin(), capture.names.end());
      std::reverse(capture.features.begin(), capture.features.end());
    }
    EXPECT_DOUBLE_EQ(Compare(capture).contradicting_share, 5.0 / 15);
    EXPECT_DOUBLE_EQ(Compare(capture).following_contradicting_share, 3.0 / 12);
  }
}

TEST(PairAgreement, PicturesOutsideTheModelSayNothing) {
  Capture capture = Make();
  capture.scene.frames.pop_back();
  EXPECT_EQ(Compare(capture).pairs, 3);
}

}  // namespace
