// Cells that training samples touched, those beside them, and what a field shows elsewhere.
#include "nerf/fields/trained_cells.h"

#include <gtest/gtest.h>

#include "nerf/fields/hash_field.h"
#include "tests/support/scenes/field_tensor.h"

namespace nerf {
namespace {

Samples At(std::initializer_list<float> xs) {
  Samples samples;
  for (const float x : xs) samples.x.push_back(x), samples.y.push_back(0.5f), samples.z.push_back(0.25f);
  return samples;
}

TEST(TrainedCells, CountsTheSecondHalfOfTrainingSoFar) {
  TrainedCells cells;
  EXPECT_TRUE(cells.ContainsAll());
  EXPECT_TRUE(cells.Contains(0.1f, 0.5f, 0.25f)) << "of a field that nothing was marked for, all are trained";
  cells.Mark(At({0.1f, 0.9f}), 0.1);
  cells.Refresh();
  EXPECT_TRUE(cells.Contains(0.1f, 0.5f, 0.25f));
  EXPECT_FALSE(cells.Contains(0.5f, 0.5f, 0.25f));
  cells.Mark(At({0.9f}), 0.2);
  cells.Refresh();
  EXPECT_TRUE(cells.Contains(0.1f, 0.5f, 0.25f));
  cells.Mark(At({0.9f}), 0.3);
  cells.Refresh();
  EXPECT_FALSE(cells.Contains(0.1f, 0.5f, 0.25f)) << "fog that has gone";
  EXPECT_TRUE(cells.Contains(0.9f, 0.5f, 0.25f));
}

TEST(TrainedCells, CellsThatShareAFaceWithATrainedOneAreTrained) {
  constexpr float kCell = 1.f / TrainedCells::kResolution;
  TrainedCells cells;
  cells.Mark(At({0.5f * kCell, 0.5f + 0.5f * kCell}), 1);
  cells.Refresh();
  for (const float side : {-kCell, kCell}) {
    const float x = 0.5f + 0.5f * kCell;
    EXPECT_TRUE(cells.Contains(x + side, 0.5f, 0.25f));
    EXPECT_TRUE(cells.Contains(x, 0.5f + side, 0.25f));
    EXPECT_TRUE(cells.Contains(x, 0.5f, 0.25f + side));
    EXPECT_FALSE(cells.Contains(x + side, 0.5f + side, 0.25f));
    EXPECT_FALSE(cells.Contains(x + 2 * side, 0.5f, 0.25f));
    EXPECT_TRUE(cells.IsNear(x + 2 * side, 0.5f + side, 0.25f - side));
    EXPECT_FALSE(cells.IsNear(x + 3 * side, 0.5f, 0.25f));
    EXPECT_FALSE(cells.IsNear(x + 2 * side, 0.5f + 2 * side, 0.25f));
  }
  EXPECT_FALSE(cells.Contains(1 - 0.5f * kCell, 0.5f, 0.25f)) << "the cube does not close on itself";
}

TEST(TrainedCells, FacesOfTheCubeBelongToTheOutermostCells) {
  TrainedCells cells;
  cells.Mark(At({0.f, 1.f}), 1);
  cells.Refresh();
  EXPECT_TRUE(cells.Contains(0.5f / TrainedCells::kResolution, 0.5f, 0.25f));
  EXPECT_TRUE(cells.Contains(1 - 0.5f / TrainedCells::kResolution, 0.5f, 0.25f));
}

TEST(TrainedCells, TimesComeBackFromACheckpoint) {
  TrainedCells cells, copy;
  cells.Mark(At({0.1f}), 0.5);
  cells.Refresh();
  std::copy(cells.times().begin(), cells.times().end(), copy.times().begin());
  copy.Refresh();
  EXPECT_FALSE(copy.ContainsAll());
  EXPECT_TRUE(copy.Contains(0.1f, 0.5f, 0.25f));
  EXPECT_FALSE(copy.Contains(0.5f, 0.5f, 0.25f));
}

// Hashed levels are left out where nothing was trained, and nothing else changes.
TEST(TrainedCells, UntrainedPlacesKeepTheDenseLevelsOfTheField) {
  const HashFieldOptions options = {
      .grid = {.n_levels = 8, .log2_hashmap_size = 8, .base_resolution = 3, .finest_resolution = 40}};
  HashField field(options, 5), dense(options, 5);
  const std::vector<kernels::GridLevel>& levels = field.grid().levels();
  for (HashField* f : {&field, &dense}) {
    const std::span<float> table = tests::TensorOf(f, "table");
    for (std::size_t i = 0; i < table.size(); ++i) table[i] = static_cast<float>(i % 17) / 17 - 0.5f;
    if (f == &field) continue;
    for (const kernels::GridLevel& level : levels) {
      const auto first = table.begin() + static_cast<std::ptrdiff_t>(level.first_entry * kernels::kFeatures);
      if (level.hash_mask != 0)
        std::fill_n(first, static_cast<std::ptrdiff_t>(level.n_entries * kernels::kFeatures), 0.f);
    }
    f->Refresh();
  }
  ASSERT_EQ(levels.front().hash_mask, 0u);
  ASSERT_NE(levels.back().hash_mask, 0u);
  const Samples samples = At({0.1f, 0.4f, 0.8f});
  float whole[3], coarse[3], masked[3];
  field.QueryDensity(samples, whole);
  dense.QueryDensity(samples, coarse);
  field.trained_cells().Mark(At({0.4f}), 1);
  field.trained_cells().Refresh();
  field.QueryDensity(samples, masked);
  EXPECT_EQ(masked[0], coarse[0]);
  EXPECT_EQ(masked[1], whole[1]);
  EXPECT_EQ(masked[2], coarse[2]);
  EXPECT_NE(whole[0], coarse[0]);
}

}  // namespace
}  // namespace nerf
