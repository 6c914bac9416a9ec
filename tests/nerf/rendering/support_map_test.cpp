// Which views saw what a picture shows: a sphere, whose visible side is known.
#include "nerf/rendering/support_map.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <numbers>

#include "tests/support/scenes/look_at.h"
#include "tests/support/scenes/sphere_field.h"

namespace {

using Eigen::Vector3d;
using std::numbers::pi;

// Cameras at distance 4 that look at the unit sphere from the given azimuths.
io::Scene CamerasAt(const std::vector<double>& azimuths_deg) {
  io::Scene scene = tests::RingScene(1, 120, 90, [](int) { return ""; });
  scene.frames.clear();
  for (const double azimuth : azimuths_deg) {
    const double a = azimuth * pi / 180;
    scene.frames.push_back(
        {"", 0, LookAt(4 * Vector3d(std::cos(a), std::sin(a), 0), Vector3d::Zero(), Vector3d::UnitZ()), {}});
  }
  return scene;
}

nerf::ViewSupport SupportSeenFrom(const io::Scene& train, double azimuth_deg) {
  const tests::SphereField field;
  const nerf::SupportMap map(field, train, 1);
  const io::Scene film = CamerasAt({azimuth_deg});
  const io::Rigid3d& pose = film.frames[0].world_from_cam;
  return map.Of(film.cameras[0], pose, field.Render(film.cameras[0], pose, {}), 2);
}

std::size_t Middle(const nerf::ViewSupport& support) {
  return static_cast<std::size_t>(support.height / 2 * support.width + support.width / 2);
}

TEST(SupportMap, CountsTheViewsThatSawTheSurfaceAndTheirAngle) {
  const nerf::ViewSupport support = SupportSeenFrom(CamerasAt({-20, 0, 20, 180}), 0);
  EXPECT_EQ(support.views[Middle(support)], 3);  // the one behind the sphere did not
  // From the surface point (1, 0, 0) the outer two stand further apart than from the centre.
  const double apart = 2 * std::atan2(4 * std::sin(pi / 9), 4 * std::cos(pi / 9) - 1);
  EXPECT_NEAR(support.angle[Middle(support)], apart, 0.03);
  EXPECT_EQ(support.UnobservedShare(), 0);
}

TEST(SupportMap, TheFarSideOfTheSubjectIsNotObserved) {
  const nerf::ViewSupport support = SupportSeenFrom(CamerasAt({150, 180, 210}), 0);
  EXPECT_EQ(support.views[Middle(support)], 0);
  EXPECT_EQ(support.observed[Middle(support)], 0);
  EXPECT_GT(support.UnobservedShare(), 0.1);
}

TEST(SupportMap, ATrainingViewHasObservedAllOfItself) {
  const nerf::ViewSupport support = SupportSeenFrom(CamerasAt({0, 90}), 0);
  EXPECT_EQ(support.UnobservedShare(), 0);
  for (const int n : support.views) EXPECT_GE(n, 1);
}

TEST(SupportMap, OnePointIsSupportedAsThePixelThatShowsIt) {
  const io::Scene train = CamerasAt({-20, 0, 20, 180});
  const nerf::SupportMap map(tests::SphereField(), train, 1);
  const double pixel_angle = nerf::PixelAngle(train.cameras[0]);
  const Vector3d film_centre = train.frames[1].world_from_cam.translation;
  EXPECT_EQ(map.ViewsOf({1, 0, 0}, film_centre, pixel_angle), 3);
  EXPECT_EQ(map.ViewsOf({-1, 0, 0}, train.frames[3].world_from_cam.translation, pixel_angle), 1);
  EXPECT_EQ(map.ViewsOf({1.5, 0, 0}, film_centre, pixel_angle),
            1);  // in the air: right for its own ray alone
}

TEST(SupportMap, MasksHideWhatTheyLeaveOut) {
  io::Scene train = CamerasAt({0});
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("support_mask" + std::to_string(getpid()) + ".png");
  io::Mask mask{.width = 120, .height = 90, .used = std::vector<std::uint8_t>(120 * 90, 0)};
  for (int y = 0; y < 90; ++y) std::fill_n(mask.used.begin() + 120 * y, 60, 255);  // the left half is used
  io::WriteMask(path, mask);
  train.frames[0].mask_path = path;
  const nerf::ViewSupport support = SupportSeenFrom(train, 0);
  const auto row = static_cast<std::size_t>(support.height / 2 * support.width);
  EXPECT_EQ(support.observed[row + static_cast<std::size_t>(support.width) / 4], 1);
  EXPECT_EQ(support.observed[row + static_cast<std::size_t>(support.width) * 3 / 4], 0);
  std::filesystem::remove(path);
}

TEST(SupportMap, QuickAnswerIsThatOfTheFullOne) {
  const tests::SphereField field;
  const io::Scene train = CamerasAt({60, 100, 150}), film = CamerasAt({0});
  const nerf::SupportMap map(field, train, 1);
  const io::Rigid3d& pose = film.frames[0].world_from_cam;
  const nerf::RenderedView view = field.Render(film.cameras[0], pose, {});
  const nerf::ViewSupport full = map.Of(film.cameras[0], pose, view, 2);
  EXPECT_EQ(map.ObservedIn(film.cameras[0], pose, view, 1).observed, full.observed);
  EXPECT_GT(full.UnobservedShare(), 0);
  EXPECT_LT(full.UnobservedShare(), 0.5);
}

TEST(Veil, CoversWhereMostLightIsOfWhatWasNotLearnt) {
  nerf::RenderedView view{.width = 5, .height = 1};
  view.rgb.assign(15, 0.5f);
  view.unlearnt = {0, 0.5f, 0.7f, 0.95f, 0.6f};
  nerf::VeilUnlearnt({0.1f, 0.1f, 0.1f}, &view);
  EXPECT_EQ(view.rgb[0], 0.5f);
  EXPECT_EQ(view.rgb[3], 0.5f);
  EXPECT_NEAR(view.rgb[6], 0.3f, 1e-6);
  EXPECT_NEAR(view.rgb[9], 0.1f, 1e-6);
  EXPECT_NEAR(view.rgb[12], 0.5 - 0.4 * 0.15625, 1e-6);  // a quarter of the way, by a smooth step
}

TEST(Veil, CoversHolesWithASoftEdgeAndLeavesSpecks) {
  nerf::ViewSupport support{.width = 32, .height = 24, .views = {}, .angle = {}, .observed = {}};
  support.observed.assign(32 * 24, 1);
  for (int y = 0; y < 24; ++y) std::fill_n(support.observed.begin() + 32 * y, 16, 0);  // the left half
  support.observed[12 * 32 + 28] = 0;                                                  // and a speck
  nerf::RenderedView view{
      .width = 64, .height = 48, .rgb = std::vector<float>(64 * 48 * 3, 0.8f), .depth = {}, .opacity = {}};
  nerf::VeilUnobserved(support, {0.1f, 0.1f, 0.1f}, false, &view);
  const auto red = [&](int x) { return view.rgb[3 * static_cast<std::size_t>(24 * 64 + x)]; };
  EXPECT_FLOAT_EQ(red(4), 0.1f);
  EXPECT_FLOAT_EQ(red(40), 0.8f);
  EXPECT_FLOAT_EQ(red(57), 0.8f);
  float largest_step = 0;
  for (int x = 1; x < 64; ++x) largest_step = std::max(largest_step, std::abs(red(x) - red(x - 1)));
  EXPECT_LT(largest_step, 0.35f);
  // Before a crop box's background only what is there is covered.
  std::fill(view.rgb.begin(), view.rgb.end(), 0.8f);
  view.opacity.assign(64 * 48, 0);
  view.opacity[24 * 64 + 4] = 1;
  nerf::VeilUnobserved(support, {0.1f, 0.1f, 0.1f}, true, &view);
  EXPECT_FLOAT_EQ(red(4), 0.1f);
  EXPECT_FLOAT_EQ(red(5), 0.8f);
}

}  // namespace
