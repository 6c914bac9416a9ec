// Each cause of failure, from evidence made by hand.
#include "sfm/mapping/diagnosis.h"

#include <gtest/gtest.h>

namespace {

using sfm::PairGeometry;
using sfm::RefusalCause;

sfm::CaptureEvidence Evidence(int n, int features, double scale_px, int inliers, PairGeometry geometry) {
  sfm::CaptureEvidence evidence;
  for (int i = 0; i < n; ++i) evidence.features.push_back({std::to_string(i), features, scale_px});
  for (int i = 0; i + 1 < n; ++i) {
    evidence.pairs.push_back({std::to_string(i), std::to_string(i + 1), inliers, geometry});
  }
  return evidence;
}

// n cameras on an arc of `span_deg` around the origin, which holds all points.
io::ColmapModel Arc(int n, double span_deg) {
  io::ColmapModel model;
  model.mean_reprojection_error_px = 0.5;
  io::Point3D point;
  for (int i = 0; i < n; ++i) {
    const double angle = span_deg / 180 * EIGEN_PI * i / (n - 1);
    io::Frame frame;
    frame.world_from_cam.translation = Eigen::Vector3d(std::sin(angle), 0, std::cos(angle)) * 4;
    frame.image_path = std::to_string(i);
    model.scene.frames.push_back(frame);
    point.frame_indices.push_back(i);
  }
  for (int i = 0; i < 12; ++i) {
    point.xyz = 1e-12 * Eigen::Vector3d(i % 2, i / 2 % 2, i / 4);  // a point, seen from 4
    model.scene.points.push_back(point);
  }
  return model;
}

TEST(Diagnosis, CausesOfFailure) {
  const auto cause = [](const sfm::CaptureEvidence& evidence, int registered = 0) {
    return sfm::ExplainFailure(evidence, registered).cause;
  };
  EXPECT_EQ(cause(Evidence(2, 2000, 2, 300, PairGeometry::kGeneral)), RefusalCause::kTooFewPictures);
  EXPECT_EQ(cause(Evidence(20, 40, 2, 0, PairGeometry::kGeneral)), RefusalCause::kNoTexture);
  EXPECT_EQ(cause(Evidence(20, 0, 0, 0, PairGeometry::kGeneral)), RefusalCause::kNoTexture);
  EXPECT_EQ(cause(Evidence(20, 40, 7, 0, PairGeometry::kGeneral)), RefusalCause::kBlur);
  EXPECT_EQ(cause(Evidence(20, 2000, 2, 300, PairGeometry::kRotation)), RefusalCause::kRotationOnly);
  EXPECT_EQ(cause(Evidence(20, 2000, 2, 16, PairGeometry::kGeneral), 3), RefusalCause::kNoOverlap);
  // All linked, as in a walk straight ahead: more overlap would not help.
  sfm::CaptureEvidence linked = Evidence(20, 2000, 2, 300, PairGeometry::kGeneral);
  EXPECT_EQ(cause(linked, 3), RefusalCause::kMisfit);
  linked.pairs[9].inliers = 16;  // two halves
  const sfm::Refusal halves = sfm::ExplainFailure(linked, 10);
  EXPECT_EQ(halves.cause, RefusalCause::kNoOverlap);
  EXPECT_NE(halves.figures.find("matches has 10"), std::string::npos) << halves.figures;
}

TEST(Diagnosis, TriangulationAngleOfAnArcIsItsSpan) {
  EXPECT_NEAR(sfm::MedianTriangulationAngleDeg(Arc(5, 30).scene), 30, 1e-9);
  EXPECT_NEAR(sfm::MedianTriangulationAngleDeg(Arc(5, 1e-5).scene), 1e-5, 1e-12);
  EXPECT_EQ(sfm::MedianTriangulationAngleDeg({}), 0);
}

TEST(Diagnosis, AGoodModelIsAccepted) {
  EXPECT_FALSE(sfm::JudgeModel(Arc(10, 60), Evidence(10, 2000, 2, 300, PairGeometry::kGeneral)).has_value());
}

TEST(Diagnosis, PointsOnALineAreNoModel) {
  io::ColmapModel model = Arc(12, 40);
  EXPECT_GT(sfm::LineRatio(model.scene), 0.3);
  for (std::size_t i = 0; i < model.scene.points.size(); ++i) {
    model.scene.points[i].xyz =
        Eigen::Vector3d(0.1, 0.2, 0.3) * static_cast<double>(i) + 1e-3 * Eigen::Vector3d(i % 2, i % 3, 0);
  }
  EXPECT_LT(sfm::LineRatio(model.scene), 0.01);
  const auto refusal = sfm::JudgeModel(model, Evidence(12, 2000, 2, 200, PairGeometry::kGeneral));
  EXPECT_EQ(refusal.value().cause, RefusalCause::kPointsOnOneLine);
}

TEST(Diagnosis, ModelsThatMustBeRefused) {
  const auto cause = [](const io::ColmapModel& model, const sfm::CaptureEvidence& evidence) {
    return sfm::JudgeModel(model, evidence).value().cause;
  };
  const auto good = Evidence(10, 2000, 2, 300, PairGeometry::kGeneral);
  EXPECT_EQ(cause(Arc(10, 1.0), good), RefusalCause::kNarrowRays);
  EXPECT_EQ(cause(Arc(10, 60), Evidence(10, 2000, 2, 300, PairGeometry::kRotation)),
            RefusalCause::kRotationOnly);
  EXPECT_EQ(cause(Arc(2, 60), Evidence(10, 2000, 2, 16, PairGeometry::kGeneral)), RefusalCause::kNoOverlap);
  EXPECT_EQ(cause(Arc(2, 60), good), RefusalCause::kMisfit);
  io::ColmapModel inaccurate = Arc(10, 60);
  inaccurate.mean_reprojection_error_px = 5;
  EXPECT_EQ(cause(inaccurate, good), RefusalCause::kLargeError);
  inaccurate.mean_reprojection_error_px = std::nan("");
  EXPECT_EQ(cause(inaccurate, good), RefusalCause::kLargeError);
}

TEST(Diagnosis, HomographiesBetweenClosePicturesAreNormal) {
  // Neighbours 3 degrees apart are explained by homographies, pictures 30 degrees apart are not.
  auto evidence = Evidence(21, 2000, 2, 300, PairGeometry::kRotation);
  evidence.pairs.push_back({"0", "10", 200, PairGeometry::kGeneral});
  EXPECT_GT(sfm::RotationShare(evidence.pairs), 0.9);
  EXPECT_EQ(sfm::FoldedShare(Arc(21, 60).scene, evidence.pairs), 0);
  EXPECT_FALSE(sfm::JudgeModel(Arc(21, 60), evidence).has_value());
  evidence.pairs.back().geometry = PairGeometry::kRotation;
  EXPECT_EQ(sfm::FoldedShare(Arc(21, 60).scene, evidence.pairs), 1);
}

TEST(Diagnosis, APlaneSeenFromTwoPlacesIsNoRotation) {
  const auto planes = Evidence(10, 2000, 2, 300, PairGeometry::kPlane);
  EXPECT_EQ(sfm::RotationShare(planes.pairs), 0);
  EXPECT_EQ(sfm::ExplainFailure(planes, 0).cause, RefusalCause::kMisfit);
  io::ColmapModel model = Arc(10, 60);
  EXPECT_TRUE(sfm::IsFlat(model.scene, planes.pairs));
  for (std::size_t i = 0; i < model.scene.points.size(); ++i) {
    model.scene.points[i].xyz =
        1e-3 * Eigen::Vector3d(static_cast<double>(i % 4), static_cast<double>(i / 4), 0);
  }
  EXPECT_LT(sfm::PlaneRatio(model.scene), 1e-6);
  EXPECT_FALSE(sfm::JudgeModel(model, planes).has_value());
  // The same evidence with points all over a volume: the camera turned, and the mapper made up the rest.
  EXPECT_GT(sfm::PlaneRatio(Arc(10, 60).scene), 0.3);
  EXPECT_EQ(sfm::JudgeModel(Arc(10, 60), planes).value().cause, RefusalCause::kRotationOnly);
}

TEST(Diagnosis, PairsWithLittleSupportSayNothingAboutRotation) {
  auto evidence = Evidence(10, 2000, 2, 300, PairGeometry::kGeneral);
  for (int i = 0; i < 100; ++i) evidence.pairs.push_back({"0", "5", 16, PairGeometry::kRotation});
  EXPECT_EQ(sfm::RotationShare(evidence.pairs), 0);
  EXPECT_EQ(sfm::RotationShare({}), 0);
}

TEST(Diagnosis, CausesOfOneMissingPicture) {
  sfm::CaptureEvidence evidence{.features = {{"a", 50, 2}, {"b", 50, 8}, {"c", 2000, 2}, {"d", 2000, 2}},
                                .pairs = {{"c", "a", 17}, {"d", "a", 120}}};
  EXPECT_EQ(sfm::ExplainMissingPicture("a", evidence).cause, RefusalCause::kNoTexture);
  EXPECT_EQ(sfm::ExplainMissingPicture("b", evidence).cause, RefusalCause::kBlur);
  const sfm::Refusal alone = sfm::ExplainMissingPicture("c", evidence);
  EXPECT_EQ(alone.cause, RefusalCause::kNoOverlap);
  EXPECT_NE(alone.figures.find("17 matches"), std::string::npos) << alone.figures;
  EXPECT_EQ(sfm::ExplainMissingPicture("d", evidence).cause, RefusalCause::kMisfit);
}

}  // namespace
