// sfm/scene/pose_error.h against errors that are known in closed form.
#include "sfm/scene/pose_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "sfm/synthetic/random.h"

namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

Matrix3d Turn(double angle, const Vector3d& axis) { return AngleAxisd(angle, axis).toRotationMatrix(); }

Matrix3d RandomRotation(sfm::Random* random) {
  const Vector3d axis{random->Normal(), random->Normal(), random->Normal()};
  return Turn(random->Uniform(0, std::numbers::pi), axis.normalized());
}

// n cameras on the unit circle around z.
io::Scene Circle(int n) {
  sfm::Random random(7, 0);
  io::Scene scene;
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * std::numbers::pi * i / n;
    scene.frames.push_back(
        {.image_path = "folder/" + std::to_string(i) + ".jpg",
         .world_from_cam = {RandomRotation(&random), Vector3d(std::cos(angle), std::sin(angle), 0)}});
  }
  return scene;
}

io::Scene Moved(io::Scene scene, const io::Sim3d& similarity) {
  for (io::Frame& frame : scene.frames) {
    frame.world_from_cam = io::TransformPose(similarity, frame.world_from_cam);
    frame.image_path = frame.image_path.stem().string() + ".png";  // only the stem counts
  }
  return scene;
}

TEST(PoseError, ASimilarityOfTheWorldIsNoError) {
  const io::Scene truth = Circle(9);
  int cases = 0;
  for (const double scale : {1e-3, 1.0, 1e6}) {
    for (const double offset : {0.0, 1e3}) {
      const io::Sim3d similarity{
          scale, Turn(2.5, Vector3d(0.6, 0, 0.8)), scale * Vector3d(offset, -offset, 1)};
      const sfm::PoseError error = sfm::ComparePoses(Moved(truth, similarity), truth);
      EXPECT_EQ(error.matched, 9);
      // Rounding of coordinates 1e3 times the extent, 1e3 * 2^-52, leaves 2e-13; some operations more.
      EXPECT_LT(error.rotation_max_deg, 1e-12);
      EXPECT_LT(error.centre_max, 1e-11);
      for (const double auc : error.auc) EXPECT_NEAR(auc, 1, 1e-11);
      ++cases;
    }
  }
  EXPECT_EQ(cases, 6);
}

TEST(PoseError, AlignmentRecoversTheSimilarityAndItsInverse) {
  const std::vector<Vector3d> source = {{1, 2, 3}, {-2, 0, 1}, {4, 4, -1}, {0, -3, 2}};
  const io::Sim3d truth{3.5, Turn(3.1, Vector3d(0, 0.6, -0.8)), {10, -20, 30}};
  std::vector<Vector3d> target;
  for (const Vector3d& x : source) target.push_back(truth * x);
  const auto found = sfm::AlignCentres(source, target);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR(found->scale, 3.5, 1e-13);
  EXPECT_LT((found->rotation - truth.rotation).norm(), 1e-14 * 10);
  EXPECT_LT((found->translation - truth.translation).norm(), 1e-13 * 10);
}

TEST(PoseError, MirroredCentresAreNotAlignedByAReflection) {
  std::vector<Vector3d> source = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}, target = source;
  for (Vector3d& x : target) x.x() = -x.x();
  const auto found = sfm::AlignCentres(source, target);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR(found->rotation.determinant(), 1, 1e-12);
}

TEST(PoseError, AnglesAreExactNearZeroAndNearPi) {
  const Vector3d axis = Vector3d(1, 2, -3).normalized();
  int cases = 0;
  for (const double angle : {0.0, 1e-11, 1e-8, 1e-3, 1.0, std::numbers::pi - 1e-8, std::numbers::pi}) {
    const Matrix3d a = Turn(0.7, Vector3d::UnitX());
    // The entries of a rotation are rounded at 1e-16; a product and the sine of the angle make it 1e-15. The
    // arc cosine would be wrong by 1e-8.
    EXPECT_NEAR(sfm::RotationErrorDeg(a, a * Turn(angle, axis)) * kDegree, angle, 1e-15) << angle;
    ++cases;
  }
  EXPECT_EQ(cases, 7);
}

TEST(PoseError, KnownRotationErrors) {
  // Opposite errors about one axis leave the fitted rotation of the world alone.
  const io::Scene truth = Circle(5);
  io::Scene estimated = truth;
  const Matrix3d plus = Turn(2 * kDegree, Vector3d::UnitY());
  estimated.frames[1].world_from_cam.rotation = plus * truth.frames[1].world_from_cam.rotation;
  estimated.frames[3].world_from_cam.rotation = plus.transpose() * truth.frames[3].world_from_cam.rotation;
  const sfm::PoseError error = sfm::ComparePoses(estimated, truth);
  EXPECT_NEAR(error.rotation_max_deg, 2, 1e-12);
  EXPECT_NEAR(error.rotation_median_deg, 0, 1e-12);
  EXPECT_NEAR(error.auc[0], 0.6, 1e-12);  // three of five without error, two beyond the limit
  EXPECT_NEAR(error.auc[1], 0.6, 1e-12);
  EXPECT_NEAR(error.auc[2], 0.6 + 0.4 * (1 - 2.0 / 3), 1e-12);
  EXPECT_NEAR(error.auc[3], 0.6 + 0.4 * (1 - 2.0 / 5), 1e-12);
}

TEST(PoseError, MissingPicturesCountInTheAreaOnly) {
  const io::Scene truth = Circle(8);
  io::Scene estimated = truth;
  estimated.frames.resize(6);
  estimated.frames.push_back({.image_path = "unknown.jpg"});
  const sfm::PoseError error = sfm::ComparePoses(estimated, truth);
  EXPECT_EQ(error.matched, 6);
  EXPECT_LT(error.rotation_max_deg, 1e-12);
  EXPECT_NEAR(error.auc[0], 0.75, 1e-12);
}

TEST(PoseError, MedianOfAnEvenNumberIsTheMiddleOfTwo) {
  io::Scene truth = Circle(4), estimated = truth;
  int i = 0;
  for (const double angle : {3.0, -3.0, 1.0, -1.0}) {
    Matrix3d& rotation = estimated.frames[static_cast<std::size_t>(i++)].world_from_cam.rotation;
    rotation = Turn(angle * kDegree, Vector3d::UnitZ()) * rotation;
  }
  const sfm::PoseError error = sfm::ComparePoses(estimated, truth);
  EXPECT_NEAR(error.rotation_median_deg, 2, 1e-12);
  EXPECT_NEAR(error.rotation_max_deg, 3, 1e-12);
}

TEST(PoseError, KnownCentreError) {
  // Centres of the unit circle lifted by +d and -d in turn: rotation and mean stay, the best scale is
  // 1 / (1 + d^2), so each centre misses by sqrt(1 - 1 / (1 + d^2)) = d / sqrt(1 + d^2).
  const double d = 0.3;
  const io::Scene truth = Circle(6);
  io::Scene estimated = truth;
  for (std::size_t i = 0; i < 6; ++i) estimated.frames[i].world_from_cam.translation.z() = i % 2 ? d : -d;
  const sfm::PoseError error = sfm::ComparePoses(estimated, truth);
  EXPECT_NEAR(error.centre_rmse, d / std::sqrt(1 + d * d), 1e-12);
  EXPECT_NEAR(error.centre_max, d / std::sqrt(1 + d * d), 1e-12);
  // The same in a world twice as large: errors are shares of the extent.
  const io::Sim3d twice{2, Matrix3d::Identity(), {5, 5, 5}};
  EXPECT_NEAR(sfm::ComparePoses(estimated, Moved(truth, twice)).extent, 2, 1e-12);
  EXPECT_NEAR(sfm::ComparePoses(estimated, Moved(truth, twice)).centre_rmse, d / std::sqrt(1 + d * d), 1e-12);
}

TEST(PoseError, DegenerateCentresAreNotAligned) {
  const std::vector<Vector3d> good = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  std::vector<Vector3d> line, spot, thin;
  for (int i = 0; i < 4; ++i) {
    line.push_back(Vector3d(1e6, 1e6, 1e6) + i * Vector3d(0.1, 0.7, 0.3));
    spot.push_back(Vector3d(1e6 / 3, 1e6 / 7, -1e6 / 9) + Vector3d(0, 1e-10 * (i % 2), 1e-10 * (i / 2)));
  }
  // A line at the origin, straight to 1e-8 of its length: more than rounding, less than poses are good for.
  for (int i = 0; i < 4; ++i) thin.push_back(Vector3d(i, i == 2 ? 1e-8 : 0, 0));
  EXPECT_TRUE(sfm::AlignCentres(good, good).has_value());
  for (const auto& bad : {line, spot, thin}) {
    EXPECT_FALSE(sfm::AlignCentres(bad, good).has_value());
    EXPECT_FALSE(sfm::AlignCentres(good, bad).has_value());
  }
  EXPECT_FALSE(sfm::AlignCentres({good[0], good[1]}, {good[0], good[1]}).has_value());
  EXPECT_FALSE(sfm::AlignCentres({}, {}).has_value());
  EXPECT_FALSE(sfm::AlignCentres(good, {good[0], good[1], good[2]}).has_value());
  // A plane is enough, and so is any extent far from the origin that is not rounding.
  EXPECT_TRUE(sfm::AlignCentres({good[0], good[1], good[2]}, {good[0], good[2], good[1]}).has_value());
  std::vector<Vector3d> far_away;
  for (const Vector3d& x : good) far_away.push_back(1e-3 * x + Vector3d(1e6, 1e6, 0));
  EXPECT_TRUE(sfm::AlignCentres(good, far_away).has_value());
}

TEST(PoseError, RotationsAreComparedWhereCentresCannotBe) {
  io::Scene truth = Circle(5);
  for (std::size_t i = 0; i < 5; ++i)
    truth.frames[i].world_from_cam.translation = Vector3d(static_cast<double>(i), 0, 0);
  io::Scene estimated = Moved(truth, {2, Turn(1, Vector3d::UnitZ()), {1, 2, 3}});
  sfm::PoseError error = sfm::ComparePoses(estimated, truth);
  EXPECT_TRUE(std::isnan(error.centre_rmse));
  EXPECT_TRUE(std::isnan(error.centre_max));
  EXPECT_LT(error.rotation_max_deg, 1e-12);

  // A collapsed estimate of good centres is an infinite error, not an unknown one.
  truth = Circle(5);
  estimated = truth;
  for (io::Frame& frame : estimated.frames) frame.world_from_cam.translation = Vector3d(1, 1, 1);
  error = sfm::ComparePoses(estimated, truth);
  EXPECT_TRUE(std::isinf(error.centre_rmse));
  EXPECT_TRUE(std::isinf(error.centre_max));

  error = sfm::ComparePoses({}, truth);
  EXPECT_EQ(error.matched, 0);
  EXPECT_TRUE(std::isnan(error.rotation_max_deg));
  EXPECT_TRUE(std::isnan(error.centre_rmse));
}

}  // namespace
