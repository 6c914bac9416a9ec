// Two models of overlapping parts of a capture: how one lies in the other, and what their union holds.
#include "sfm/mapping/model_joining.h"

#include <gtest/gtest.h>

#include <set>

#include "sfm/scene/pose_error.h"
#include "tests/support/scenes/model_part.h"

namespace {

constexpr int kRingPictures = 14;

const io::Sim3d kElsewhere{.scale = 2.5,
                           .rotation = Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, 3).normalized()).matrix(),
                           .translation = {3, -2, 1}};

struct Parts {
  explicit Parts(double noise_px) : whole(Ring(kRingPictures, SmallCamera())) {
    std::mt19937_64 random(5);
    // Too large a cube for any picture to show all of it.
    for (int i = 0; i < 600; ++i) AddPoint(&whole, RandomVector(&random, 2.4), noise_px, &random);
    a = PartOf(whole, 0, 9);
    b = PartOf(whole, 4, kRingPictures);
    Move(&b, kElsewhere);
  }
  io::ColmapModel whole, a, b;
};

TEST(ModelJoining, FindsHowOneModelLiesInTheOther) {
  const Parts parts(0.3);
  const auto a_from_b = sfm::AlignModels(parts.a, parts.b);
  ASSERT_TRUE(a_from_b);
  const io::Sim3d identity = *a_from_b * kElsewhere;
  EXPECT_NEAR(identity.scale, 1, 1e-9);
  EXPECT_TRUE(identity.rotation.isIdentity(1e-9));
  EXPECT_LT(identity.translation.norm(), 1e-9);
}

TEST(ModelJoining, WrongPointsDoNotDecide) {
  Parts parts(0.3);
  std::mt19937_64 random(1);
  for (std::size_t i = 0; i < parts.b.scene.points.size(); i += 3)
    parts.b.scene.points[i].xyz += RandomVector(&random, 3);
  const auto a_from_b = sfm::AlignModels(parts.a, parts.b);
  ASSERT_TRUE(a_from_b);
  EXPECT_NEAR((*a_from_b * kElsewhere).scale, 1, 1e-3);
}

TEST(ModelJoining, AModelThatIsFoldedDoesNotFit) {
  Parts parts(0.3);
  for (io::Point3D& point : parts.b.scene.points) point.xyz.x() = 2 - point.xyz.x();
  EXPECT_FALSE(sfm::AlignModels(parts.a, parts.b));
}

TEST(ModelJoining, TooFewSharedPicturesOrPointsProveNothing) {
  const Parts parts(0.3);
  EXPECT_FALSE(sfm::AlignModels(parts.a, PartOf(parts.whole, 5, kRingPictures))) << "4 pictures";
  EXPECT_TRUE(sfm::AlignModels(parts.a, PartOf(parts.whole, 4, kRingPictures))) << "5 pictures";
  const io::ColmapModel few = RingModel(kRingPictures, 40, SmallCamera(), 0.3, 5);
  std::size_t seen = 0;
  for (const io::Observation& o : few.observations) seen += o.frame_index >= 4 && o.frame_index < 9;
  io::ColmapModel fewer = PartOf(few, 4, kRingPictures);
  fewer.observations.resize(49);
  EXPECT_GE(seen, 50u);
  EXPECT_FALSE(sfm::AlignModels(PartOf(few, 0, 9), fewer)) << "at most 49 shared points";
}

TEST(ModelJoining, OnePictureLinksWhatLiesBeforeIt) {
  const Parts parts(0.3);
  io::ColmapModel b = PartOf(parts.whole, 8, kRingPictures);
  Move(&b, kElsewhere);
  const auto a_from_b = sfm::AlignAtPicture(parts.a, b);
  ASSERT_TRUE(a_from_b);
  const io::Sim3d identity = *a_from_b * kElsewhere;
  EXPECT_NEAR(identity.scale, 1, 1e-9);
  EXPECT_TRUE(identity.rotation.isIdentity(1e-9));
  EXPECT_LT(identity.translation.norm(), 1e-9);
  EXPECT_FALSE(sfm::AlignAtPicture(parts.a, PartOf(parts.whole, 9, kRingPictures))) << "no picture in common";
  io::ColmapModel few = b;
  few.observations.clear();
  for (const io::Observation& o : b.observations) {
    if (o.frame_index > 0 || few.observations.size() < 7) few.observations.push_back(o);
  }
  EXPECT_FALSE(sfm::AlignAtPicture(parts.a, few)) << "at most 7 points in common";
  // The picture is put where another place looks alike: the points before it are at any distance.
  std::mt19937_64 random(2);
  for (io::Point3D& point : b.scene.points) point.xyz += RandomVector(&random, 10);
  EXPECT_FALSE(sfm::AlignAtPicture(parts.a, b));
}

TEST(ModelJoining, TheUnionHasEveryPictureAndPointOnce) {
  const Parts parts(0);
  io::ColmapModel joined = parts.a;
  const std::vector<int> camera_of(parts.b.scene.frames.size(), 0);
  sfm::AddModel(parts.b, kElsewhere.Inverse(), camera_of, &joined);
  ASSERT_EQ(joined.scene.frames.size(), static_cast<std::size_t>(kRingPictures));
  EXPECT_LT(sfm::ComparePoses(joined.scene, parts.whole.scene).rotation_max_deg, 1e-6);
  for (const io::Observation& o : joined.observations) {
    const auto xy = io::Project(joined.scene, o);
    ASSERT_TRUE(xy);
    EXPECT_LT((*xy - o.xy).norm(), 1e-6);
  }
  std::set<std::array<double, 3>> keypoints;
  std::vector<std::vector<int>> tracks(joined.scene.points.size());
  for (std::size_t i = 0; i < joined.observations.size(); ++i) {
    const io::Observation& o = joined.observations[i];
    EXPECT_TRUE(keypoints.insert({static_cast<double>(o.frame_index), o.xy.x(), o.xy.y()}).second)
        << "seen twice";
    tracks[static_cast<std::size_t>(o.point_index)].push_back(o.frame_index);
    if (i > 0) {
      EXPECT_LE(joined.observations[i - 1].point_index, o.point_index);
    }
  }
  for (std::size_t i = 0; i < tracks.size(); ++i) EXPECT_EQ(tracks[i], joined.scene.points[i].frame_indices);
  EXPECT_GT(joined.scene.points.size(), parts.a.scene.points.size());
  EXPECT_LT(joined.scene.points.size(), parts.a.scene.points.size() + parts.b.scene.points.size());
}

}  // namespace
