// Training is refused before it begins, with the figure, and its estimate holds.
#include "nerf/training/training_memory.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "nerf/training/trainer.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"

namespace nerf {
namespace {

TEST(TrainingMemory, TooLittleIsRefusedBeforeAnythingIsWritten) {
  const TempDir dir;
  const io::Scene scene = tests::BallScene(dir.path(), 8, 0);
  TrainOptions options{.steps = 10};
  options.memory = io::MemoryBudget(io::HeldMemoryBytes() + (std::size_t{1} << 20));
  EXPECT_ERROR(Train(scene, {}, options, dir / "train"),
               io::ExitCode::kNoResources,
               "training on 8 pictures needs about");
  EXPECT_FALSE(std::filesystem::exists(dir / "train/checkpoint.bin"));
}

TEST(TrainingMemory, GrowsWithPicturesTablesAndThreads) {
  EXPECT_EQ(PictureBytes(1000, 3), 3000u);
  EXPECT_EQ(PictureBytes(1000, 4), 6000u);
  const auto field_mib = [](int log2_size, int threads) {
    TrainOptions options{.steps = 10, .threads = threads};
    options.field.log2_hashmap_size = log2_size;
    return static_cast<double>(TrainedFieldBytes(options, false)) / (1 << 20);
  };
  // 2^19 entries of 4 values on 8 levels: 16 M values of 4 + 2 bytes, moments per entry at so few steps; and
  // 8 MiB of gradients per thread.
  EXPECT_NEAR(field_mib(19, 1) - field_mib(18, 1), 0.5 * (16 * 7 + 8), 1);
  EXPECT_NEAR(field_mib(19, 3) - field_mib(19, 1), 16, 1);
}

}  // namespace
}  // namespace nerf
