// The pose at which a field shows a photograph best: a chequered sphere, photographed from a known place.
#include "nerf/rendering/pose_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "io/base/error.h"
#include "nerf/sampling/pose_motion.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/sphere_field.h"

namespace nerf {
namespace {

class PoseFit : public testing::Test {
 protected:
  PoseFit() {
    const RenderedView view = field_.Render(camera_, truth_, {});
    photo_ = io::MakeImage(view.width, view.height, 3);
    for (std::size_t i = 0; i < photo_.data.size(); ++i)
      photo_.data[i] = static_cast<std::uint8_t>(std::lround(255 * view.rgb[i]));
  }

  // RMS distance in pixels of where two poses show the sphere's front.
  double PixelsBetween(const io::Rigid3d& a, const io::Rigid3d& b) const {
    double sum = 0, n = 0;
    for (int i = -5; i <= 5; ++i) {
      for (int k = -5; k <= 5; ++k) {
        const Eigen::Vector3d point = truth_.rotation * Eigen::Vector3d(0.1 * i, 0.1 * k, 0.6);
        sum += (*io::ImgFromCam(camera_, a.Inverse() * point) - *io::ImgFromCam(camera_, b.Inverse() * point))
                   .squaredNorm();
        n += 1;
      }
    }
    return std::sqrt(sum / n);
  }

  FittedPose Fit(const io::Rigid3d& from, const io::Mask& mask = {}) const {
    return FitPose(field_, camera_, from, photo_, mask, 1);
  }

  const tests::SphereField field_;
  const io::Scene scene_ = tests::RingScene(1, 320, 240, [](int) { return ""; });
  const io::Camera camera_ = scene_.cameras[0];
  const io::Rigid3d truth_ = scene_.frames[0].world_from_cam;
  // Turns and shifts that move the picture by some pixels each.
  const Vector6d motion_ = (Vector6d() << 0.03, -0.02, 0.05, 0.004, -0.006, 0.01).finished();
  io::Image photo_;
};

TEST_F(PoseFit, FindsThePlaceOfThePhotograph) {
  const io::Rigid3d wrong = MovedPose(truth_, motion_);
  ASSERT_GT(PixelsBetween(wrong, truth_), 2);
  const FittedPose fit = Fit(wrong);
  EXPECT_LT(PixelsBetween(fit.world_from_cam, truth_), 0.15);
  EXPECT_NEAR(fit.moved_px, PixelsBetween(wrong, truth_), 1);
}

TEST_F(PoseFit, ARightPoseStays) {
  const FittedPose fit = Fit(truth_);
  EXPECT_LT(PixelsBetween(fit.world_from_cam, truth_), 0.05);
  EXPECT_LT(fit.moved_px, 0.2);  // small pictures of hard edges, one ray per pixel, are jagged
}

// What a mask leaves out pulls at nothing: a bright bar, where the sphere is.
TEST_F(PoseFit, MaskedPixelsDoNotCount) {
  io::Mask mask{camera_.width, camera_.height, std::vector<std::uint8_t>(photo_.data.size() / 3, 255)};
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 100; x < 160; ++x) {
      const auto pixel = static_cast<std::size_t>(y * camera_.width + x);
      mask.used[pixel] = 0;
      for (std::size_t c = 0; c < 3; ++c) photo_.data[3 * pixel + c] = 255;
    }
  }
  const io::Rigid3d wrong = MovedPose(truth_, motion_);
  const double masked = PixelsBetween(Fit(wrong, mask).world_from_cam, truth_),
               whole = PixelsBetween(Fit(wrong).world_from_cam, truth_);
  EXPECT_LT(masked, 0.2);
  EXPECT_GT(whole, 2 * masked);
}

// A photograph without any slope says nothing about poses.
TEST_F(PoseFit, APlainPhotographMovesNothing) {
  for (std::uint8_t& value : photo_.data) value = 100;
  const FittedPose fit = Fit(truth_);
  EXPECT_EQ(fit.moved_px, 0);
  EXPECT_EQ(fit.world_from_cam.rotation, truth_.rotation);
  EXPECT_EQ(fit.world_from_cam.translation, truth_.translation);
}

// Rays beside the space of a bounded field end where they begin: no place, and nothing that moves.
class BoundedSphere : public tests::SphereField {
 public:
  RenderedView Render(const io::Camera& camera,
                      const io::Rigid3d& world_from_cam,
                      const RenderOptions& options) const override {
    RenderedView view = SphereField::Render(camera, world_from_cam, options);
    for (std::size_t i = 0; i < view.depth.size(); ++i)
      if (view.opacity[i] == 0) view.depth[i] = 0;
    return view;
  }
};

TEST_F(PoseFit, PixelsBesideABoundedFieldDoNotCount) {
  const FittedPose still = FitPose(BoundedSphere(), camera_, truth_, photo_, {}, 1);
  EXPECT_LT(still.moved_px, 0.2);
  const io::Rigid3d wrong = MovedPose(truth_, motion_);
  const FittedPose fit = FitPose(BoundedSphere(), camera_, wrong, photo_, {}, 1);
  EXPECT_LT(PixelsBetween(fit.world_from_cam, truth_), 0.15);
  EXPECT_NEAR(fit.moved_px, PixelsBetween(wrong, truth_), 1);
}

TEST_F(PoseFit, AnotherSizeIsAnError) {
  photo_ = io::ResizeArea(photo_, 319, 240);
  EXPECT_ERROR(Fit(truth_), io::ExitCode::kBadInput, "size");
}

}  // namespace
}  // namespace nerf
