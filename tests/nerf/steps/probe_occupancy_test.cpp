// Probing the occupancy grid on several ranks, of which one goes while the step that it belongs to is half
// done.
#include <gtest/gtest.h>

#include <memory>
#include <numeric>

#include "io/base/error.h"
#include "io/process/ranks.h"
#include "nerf/steps/field_training.h"
#include "tests/support/scenes/small_field.h"

namespace {

// Rank 0 of two when the other one is lost.
class LeftAlone : public io::Ranks {
 public:
  int rank() const override { return 0; }
  int size() const override { return 2; }
  std::vector<std::string> AllGather(std::string) override { throw io::Interrupted(0); }
  void Broadcast(std::string*) override { throw io::Interrupted(0); }
  void Leave() override {}
};

std::vector<float> DensityAfterProbing() {
  nerf::SceneField field = tests::SmallField();
  io::Workers workers(2);
  std::vector<std::uint32_t> candidates(field.grid.density().size());
  std::iota(candidates.begin(), candidates.end(), 0u);
  nerf::ProbeOccupancy(candidates, 4, 1, 7, 64, &field, &workers);
  return field.grid.density();
}

TEST(ProbeOccupancy, ARankThatIsLeftAloneFinishesTheStep) {
  const std::vector<float> expected = DensityAfterProbing();
  std::unique_ptr<io::Ranks> before = io::UseRanks(std::make_unique<LeftAlone>());
  const std::vector<float> alone = DensityAfterProbing();
  io::UseRanks(std::move(before));
  EXPECT_TRUE(alone == expected);
}

}  // namespace
