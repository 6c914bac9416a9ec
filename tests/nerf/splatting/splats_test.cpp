// A part of the splats of a scene.
#include "nerf/splatting/splats.h"

#include <gtest/gtest.h>

#include "tests/support/scenes/some_splats.h"

namespace nerf {
namespace {

TEST(Splats, ThoseThatAreWantedKeepTheirValues) {
  const Splats all = tests::SomeSplats(200);
  const Eigen::Vector3d place(0.2, 0.1, 0);
  constexpr double kDistance = 0.7;
  const auto is_wanted = [&](const Eigen::Vector3d& middle) { return (middle - place).norm() < kDistance; };
  const Splats within = SplatsWhere(all, is_wanted);
  std::size_t n = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Eigen::Vector3d middle(all.places[3 * i], all.places[3 * i + 1], all.places[3 * i + 2]);
    if (!is_wanted(middle)) continue;
    ASSERT_LT(n, within.size());
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(within.places[3 * n + k], all.places[3 * i + k]);
      EXPECT_EQ(within.log_scales[3 * n + k], all.log_scales[3 * i + k]);
    }
    for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(within.rotations[4 * n + k], all.rotations[4 * i + k]);
    EXPECT_EQ(within.opacities[n], all.opacities[i]);
    for (std::size_t k = 0; k < 3 * kHarmonics; ++k)
      EXPECT_EQ(within.colours[3 * kHarmonics * n + k], all.colours[3 * kHarmonics * i + k]);
    ++n;
  }
  EXPECT_EQ(n, within.size());
  EXPECT_TRUE(n > 10 && n < 190) << n;
}

}  // namespace
}  // namespace nerf
