// What training of the `hash` field weighs besides the pictures' colours.
#include <gtest/gtest.h>

#include <string>

#include "nerf/steps/field_training.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"

namespace nerf {
namespace {

// Of the first step. The field and its pictures are the same with and without a sky.
double FirstLoss(const io::Scene& scene, bool all_is_sky) {
  TrainOptions options;
  options.steps = 100;
  options.field.log2_hashmap_size = 12;
  options.field.finest_resolution = options.field.grid_resolution = 64;
  Dataset dataset = LoadDataset(scene, 1);
  dataset.sky.assign(dataset.n_pixels(), all_is_sky);
  io::Workers workers(2);
  std::string derivation;
  const auto field = MakeSceneField(scene, dataset, options.field, 1, &workers, &derivation);
  TrainState state;
  return MakeHashTraining(dataset, options, field.get(), &workers)->Step(0, &state).loss;
}

// A field begins as fog, which every ray meets. If all light came from it, its cost would be 0.03.
TEST(HashTraining, LightBeforeTheSkyCostsInUnboundedScenes) {
  const TempDir dir;
  const io::Scene room = tests::BallScene(dir / "room", 4, 0, {.size = 24, .behind = tests::Behind::kRoom});
  const double cost = FirstLoss(room, true) - FirstLoss(room, false);
  EXPECT_GT(cost, 1e-3);
  EXPECT_LE(cost, 0.03);

  const io::Scene ball = tests::BallScene(dir / "ball", 4, 0, {.size = 24});
  EXPECT_EQ(FirstLoss(ball, true), FirstLoss(ball, false));
}

}  // namespace
}  // namespace nerf
