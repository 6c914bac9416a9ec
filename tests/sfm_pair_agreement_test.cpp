// Pairs made from a known scene agree with it; moved cameras contradict them.
#include "sfm/pair_agreement.h"

#include <gtest/gtest.h>

#include <random>

namespace {

struct Capture {
  io::Scene scene;
  std::vector<std::string> names;
  std::vector<sfm::Features> features;
  std::vector<sfm::VerifiedPair> pairs;
};

// Four cameras on a line that look at the same 100 points; every pair matches all of them, and `outliers` of
// the matches are exchanged with their neighbour.
Capture Make(int outliers = 0) {
  Capture capture;
  const io::Camera camera{
      .width = 800, .height = 600, .fl_x = 700, .fl_y = 700, .cx = 400, .cy = 300, .k1 = -0.05};
  capture.scene.cameras = {camera};
  std::mt19937 random(5);
  const auto uniform = [&] { return random() / 4294967296.0 * 2 - 1; };
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 100; ++i) points.emplace_back(uniform(), 0.7 * uniform(), -6 + uniform());
  for (int i = 0; i < 4; ++i) {
    io::Frame frame;
    frame.image_path = "p" + std::to_string(i);
    frame.world_from_cam.translation = {0.6 * i - 0.9, 0.1 * i, 0};
    capture.scene.frames.push_back(frame);
    capture.names.push_back(frame.image_path.string());
    sfm::Features features;
    for (const Eigen::Vector3d& point : points) {
      const auto xy = io::ImgFromCam(camera, frame.world_from_cam.Inverse() * point);
      features.keypoints.push_back({static_cast<float>(xy->x()), static_cast<float>(xy->y())});
    }
    capture.features.push_back(features);
  }
  for (int a = 0; a < 4; ++a) {
    for (int b = a + 1; b < 4; ++b) {
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
  EXPECT_EQ(Compare(Make(40)).contradicting, 0) << "most matches still agree";
  EXPECT_EQ(Compare(Make(90)).contradicting, 6);
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

TEST(PairAgreement, ACameraThatOnlyTurnedAgrees) {
  Capture capture = Make();
  for (int i = 0; i < 4; ++i) {
    capture.scene.frames[i].world_from_cam.translation.setZero();
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

TEST(PairAgreement, PicturesOutsideTheModelSayNothing) {
  Capture capture = Make();
  capture.scene.frames.pop_back();
  EXPECT_EQ(Compare(capture).pairs, 3);
}

}  // namespace
