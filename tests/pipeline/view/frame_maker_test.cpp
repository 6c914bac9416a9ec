// Frames: as the field renders them, given up when they are no longer wanted, and the stand-in of points.
#include "pipeline/view/frame_maker.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <thread>

#include "nerf/paths/keyframe_path.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/film/depth_picture.h"
#include "pipeline/film/film.h"
#include "tests/support/scenes/sphere_field.h"

namespace pipeline {
namespace {

LiveRun::Content SphereContent() {
  LiveRun::Content content;
  content.scene = std::make_shared<io::Scene>(tests::RingScene(6, 40, 30, [](int) { return "unused.png"; }));
  content.field = std::make_shared<tests::SphereField>();
  return content;
}

FrameRequest RequestOf(const LiveRun::Content& content, int width, int height) {
  return {.viewer = "a",
          .sequence = 1,
          .camera = nerf::CameraOfView(width, height, 0.8),
          .world_from_cam = content.scene->frames[0].world_from_cam,
          .quality = ViewQuality::kFinest};
}

// A field that tells when it is rendered and waits until it may go on.
class SlowField : public tests::SphereField {
 public:
  nerf::RenderedView Render(const io::Camera& camera,
                            const io::Rigid3d& pose,
                            const nerf::RenderOptions& options) const override {
    rendering = true;
    while (!may_go_on) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return SphereField::Render(camera, pose, options);
  }
  mutable std::atomic<bool> rendering = false, may_go_on = false;
};

// A field that notes the nice value it is rendered with.
class NiceField : public tests::SphereField {
 public:
  nerf::RenderedView Render(const io::Camera& camera,
                            const io::Rigid3d& pose,
                            const nerf::RenderOptions& options) const override {
    nice = getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
    return SphereField::Render(camera, pose, options);
  }
  mutable std::atomic<int> nice = 0;
};

// A field with splats, as it were: drawn at half the size and magnified, then tinted.
class TwoStepField : public tests::SphereField {
 public:
  nerf::RenderedView Render(const io::Camera& camera,
                            const io::Rigid3d& pose,
                            const nerf::RenderOptions& options) const override {
    nerf::RenderedView view = SphereField::Render(FieldCamera(camera, options), pose, options);
    AddSplats(camera, pose, options, &view);
    return view;
  }
  io::Camera FieldCamera(const io::Camera& camera, const nerf::RenderOptions& options) const override {
    return options.splats ? io::ResizedCamera(camera, camera.width / 2, camera.height / 2) : camera;
  }
  void AddSplats(const io::Camera& camera,
                 const io::Rigid3d&,
                 const nerf::RenderOptions& options,
                 nerf::RenderedView* view) const override {
    if (!options.splats) return;
    *view = nerf::Magnified(*view, camera.width, camera.height);
    for (float& value : view->rgb) value *= 0.5f;
  }
};

TEST(FrameMaker, BandsOfASmallerFieldMakeUpTheWholePicture) {
  LiveRun::Content content = SphereContent();
  const auto field = std::make_shared<TwoStepField>();
  content.field = field;
  FrameRequest request = RequestOf(content, 600, 400);
  for (const ViewLayer layer : {ViewLayer::kColour, ViewLayer::kDepth}) {
    request.layer = layer;
    const nerf::RenderedView whole = FrameMaker::Render(request, content, 1);
    const int n_before = field->n_renders;
    const auto frame = FrameMaker(1, 0.2).Make(request, content);
    ASSERT_TRUE(frame);
    const int n_bands = field->n_renders - n_before;
    EXPECT_EQ(n_bands, layer == ViewLayer::kColour ? 4 : 15);
    const io::Image picture = layer == ViewLayer::kColour
                                  ? QuantizeView(whole)
                                  : DepthPicture(whole, content.scene->near, content.scene->far);
    EXPECT_EQ(frame->jpeg, io::EncodeImage(picture, ".jpg"));
  }
}

// Half as fine as training pictures are; while a hand moves, coarser still.
TEST(FrameMaker, TheFieldUnderSplatsIsHalfAsFineAsTheTrainingPictures) {
  const LiveRun::Content content = SphereContent();
  FrameRequest request = RequestOf(content, 200, 100);
  const auto& field = static_cast<const tests::SphereField&>(*content.field);
  const double trained = content.scene->cameras[0].fl_x;
  ASSERT_LT(trained, request.camera.fl_x);
  const auto focal_of = [&](ViewQuality quality) {
    request.quality = quality;
    FrameMaker::Render(request, content, 1);
    return field.last_options.field_focal_px;
  };
  EXPECT_EQ(focal_of(ViewQuality::kFinest), 0.5 * trained);
  EXPECT_EQ(focal_of(ViewQuality::kFull), 0.5 * trained);
  EXPECT_LT(focal_of(ViewQuality::kFast), 0.4 * trained);
}

TEST(FrameMaker, BandsMakeUpTheWholePicture) {
  const LiveRun::Content content = SphereContent();
  const FrameRequest request = RequestOf(content, 300, 200);  // four bands
  const nerf::RenderedView whole = FrameMaker::Render(request, content, 1);
  const auto n_before = static_cast<const tests::SphereField&>(*content.field).n_renders;
  const auto frame = FrameMaker(1, 0.2).Make(request, content);
  ASSERT_TRUE(frame);
  EXPECT_GT(static_cast<const tests::SphereField&>(*content.field).n_renders, n_before + 1);
  EXPECT_EQ(frame->jpeg, io::EncodeImage(QuantizeView(whole), ".jpg"));
}

TEST(FrameMaker, MovingPicturesAreSampledCoarsely) {
  const LiveRun::Content content = SphereContent();
  FrameRequest request = RequestOf(content, 20, 10);
  const auto& field = static_cast<const tests::SphereField&>(*content.field);
  FrameMaker maker(1, 0.2);
  maker.Make(request, content);
  EXPECT_EQ(field.last_options.step_scale, 0);  // as pictures are scored
  request.quality = ViewQuality::kFast;
  maker.Make(request, content);
  EXPECT_EQ(field.last_options.step_scale, 1);
  EXPECT_EQ(field.last_options.samples_per_pixel, 1);
}

TEST(FrameMaker, PicturesGiveWayToATraining) {
  LiveRun::Content content = SphereContent();
  const auto field = std::make_shared<NiceField>();
  content.field = field;
  FrameMaker maker(1, 0.2);
  ASSERT_TRUE(maker.Make(RequestOf(content, 20, 10), content));
  const int alone = field->nice;
  content.is_training = true;
  ASSERT_TRUE(maker.Make(RequestOf(content, 20, 10), content));
  EXPECT_EQ(field->nice, std::min(alone + 10, 19));
}

TEST(FrameMaker, ALaterRequestReplacesAnEarlierOneOfTheSamePageOnly) {
  LiveRun::Content content = SphereContent();
  const auto field = std::make_shared<SlowField>();
  content.field = field;
  FrameMaker maker(1, 0.2);
  FrameRequest large = RequestOf(content, 300, 200), small = RequestOf(content, 20, 10);
  std::optional<ViewFrame> replaced, later, other;
  std::thread first([&] { replaced = maker.Make(large, content); });
  while (!field->rendering) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  small.sequence = 2;
  std::thread second([&] { later = maker.Make(small, content); });
  FrameRequest elsewhere = small;
  elsewhere.viewer = "b", elsewhere.sequence = 1;
  std::thread third([&] { other = maker.Make(elsewhere, content); });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  field->may_go_on = true;
  for (std::thread* thread : {&first, &second, &third}) thread->join();
  EXPECT_FALSE(replaced);
  EXPECT_TRUE(later);
  EXPECT_TRUE(other);
  EXPECT_FALSE(maker.Make(large, content));  // comes late
}

TEST(FrameMaker, NothingWithoutAScene) {
  const LiveRun::Content content = SphereContent();
  EXPECT_FALSE(FrameMaker(1, 0.2).Make(RequestOf(content, 20, 10), {}));
}

TEST(RenderPoints, NearerPointsStandBeforeFartherOnes) {
  const io::Camera camera = nerf::CameraOfView(41, 41, 1.0);
  const io::Rigid3d pose;  // looks along -z
  std::vector<io::Point3D> points = {{.xyz = {0, 0, -2}, .rgb = {255, 0, 0}},
                                     {.xyz = {0, 0, -5}, .rgb = {0, 255, 0}},
                                     {.xyz = {0, 0, 3}, .rgb = {0, 0, 255}},
                                     {.xyz = {1e300, 0, -1}, .rgb = {0, 0, 255}}};
  for (int round = 0; round < 2; ++round, std::swap(points[0], points[1])) {
    const nerf::RenderedView view = RenderPoints(points, camera, pose);
    const std::size_t middle = 20 * 41 + 20;
    EXPECT_EQ(view.rgb[3 * middle], 1.f);
    EXPECT_EQ(view.rgb[3 * middle + 1], 0.f);
    EXPECT_FLOAT_EQ(view.depth[middle], 2);
    EXPECT_EQ(std::count(view.opacity.begin(), view.opacity.end(), 1.f), 1);
  }
}

}  // namespace
}  // namespace pipeline
