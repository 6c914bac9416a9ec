// Blocks of a capture, of which one is wrong.
#include "sfm/mapping/joined_model.h"

#include <gtest/gtest.h>

#include "sfm/scene/pose_error.h"
#include "tests/support/scenes/model_part.h"

namespace {

constexpr int kInThree = 24;

class JoinedBlocksTest : public testing::Test {
 protected:
  JoinedBlocksTest() : whole_(Ring(kInThree, SmallCamera())) {
    std::mt19937_64 random(5);
    for (int i = 0; i < 1500; ++i) AddPoint(&whole_, RandomVector(&random, 2.4), 0.3, &random);
    group_ = {.width = 640, .height = 480};
    for (const io::Frame& frame : whole_.scene.frames) group_.names.push_back(frame.image_path.string());
  }

  // Joins blocks of pictures 0 to 11, 6 to 17 and 12 to 23, each in a world of its own.
  sfm::JoinedModel Join(const std::function<void(io::ColmapModel*)>& damage_last) {
    others_ = {{"middle", PartOf(whole_, 6, 18)}, {"last", PartOf(whole_, 12, kInThree)}};
    const io::Sim3d elsewhere{.scale = 0.4,
                              .rotation = Eigen::AngleAxisd(2, Eigen::Vector3d::UnitX()).matrix(),
                              .translation = {1, 0, 5}};
    for (sfm::FoundModel& other : others_) Move(&other.model, elsewhere);
    damage_last(&others_.back().model);
    sfm::JoinedModel joined({group_}, PartOf(whole_, 0, 12));
    joined.JoinAll(&others_);
    return joined;
  }
  // Of the joined cameras to the true ones.
  sfm::PoseError ErrorOf(sfm::JoinedModel* joined) const {
    return sfm::ComparePoses(joined->model()->scene, whole_.scene);
  }

  io::ColmapModel whole_;
  sfm::CameraGroup group_;
  std::vector<sfm::FoundModel> others_;  // that were not joined
};

TEST_F(JoinedBlocksTest, BecomeOneModel) {
  sfm::JoinedModel joined = Join([](io::ColmapModel*) {});
  EXPECT_TRUE(others_.empty());
  EXPECT_EQ(joined.model()->scene.frames.size(), static_cast<std::size_t>(kInThree));
  EXPECT_LT(ErrorOf(&joined).rotation_max_deg, 1e-6);
}

// Puts the pictures of a block from `first` on, and what they show, where its first ones are, as where two
// sides look alike.
void Fold(std::size_t first, io::ColmapModel* block) {
  std::vector<io::Frame>& frames = block->scene.frames;
  const io::Rigid3d onto = frames[0].world_from_cam * frames[first].world_from_cam.Inverse();
  for (std::size_t i = first; i < frames.size(); ++i)
    frames[i].world_from_cam = onto * frames[i].world_from_cam;
  std::vector<int> seen(block->scene.points.size(), 0), seen_behind = seen;
  for (const io::Observation& o : block->observations) {
    ++seen[static_cast<std::size_t>(o.point_index)];
    seen_behind[static_cast<std::size_t>(o.point_index)] += o.frame_index >= static_cast<int>(first);
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (2 * seen_behind[i] > seen[i]) block->scene.points[i].xyz = onto * block->scene.points[i].xyz;
  }
}

TEST_F(JoinedBlocksTest, AFoldAmongSharedPicturesMovesNoCamera) {
  for (const std::size_t first : {1u, 2u, 3u, 4u, 5u}) {
    sfm::JoinedModel joined = Join([&](io::ColmapModel* block) { Fold(first, block); });
    EXPECT_LT(ErrorOf(&joined).rotation_max_deg, 1e-6) << first;
  }
}

// What no other block shows cannot be told here: pairs with its pictures contradict it (pair_agreement.h).
TEST_F(JoinedBlocksTest, AFoldElsewhereIsLeftToThePairs) {
  sfm::JoinedModel joined = Join([](io::ColmapModel* block) { Fold(7, block); });
  EXPECT_TRUE(others_.empty());
  EXPECT_GT(ErrorOf(&joined).rotation_max_deg, 30);
}

}  // namespace
