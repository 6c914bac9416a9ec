// The second look: what is looked at, what it costs, and that a model grows by it without being made anew.
#include "sfm/second_look.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "sfm/scene/pose_error.h"
#include "sfm/synthetic/synthetic_capture.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/require_program.h"

namespace {

using Names = std::vector<std::string>;
using Indices = std::vector<int>;

// A ring of which the mapper first gets only the matches that touch no picture of `unseen`.
struct Ring {
  explicit Ring(std::set<int> left_out) : unseen(std::move(left_out)) {
    capture = sfm::MakeSyntheticCapture({.pictures = 10, .points = 200, .noise_px = 0.3, .seed = 4});
    views = std::make_shared<sfm::CapturedViews>(sfm::CapturedViews{
        sfm::Names(capture.pictures), sfm::CameraGroups(capture.pictures), capture.features});
    for (const sfm::PairMatches& pair : capture.matches)
      (unseen.count(pair.a) + unseen.count(pair.b) > 0 ? later : first).push_back(pair);
    for (const int i : unseen) names.push_back(capture.pictures[static_cast<std::size_t>(i)].name);
  }

  sfm::MappingAttempt Map(const std::filesystem::path& folder) const {
    return sfm::Attempt(capture.pictures, views, first, "", folder, {.threads = 2});
  }
  sfm::MappingAttempt Grow(const sfm::MappingAttempt& before, const std::filesystem::path& folder) const {
    return sfm::Continue(before, capture.pictures, views, later, names, "", folder, 2);
  }

  std::set<int> unseen;
  sfm::SyntheticCapture capture;
  std::shared_ptr<sfm::CapturedViews> views;
  std::vector<sfm::PairMatches> first, later;
  Names names;
};

TEST(SecondLook, AModelGrowsByThePicturesItLacked) {
  REQUIRE_PROGRAM("colmap");
  const TempDir dir;
  const Ring ring({3, 7});
  const sfm::MappingAttempt before = ring.Map(dir / "before");
  ASSERT_EQ(before.Registered(), 8);
  EXPECT_EQ(sfm::LeftOutPictures(before), (std::vector<int>{3, 7}));
  sfm::MappingAttempt after = ring.Grow(before, dir / "after");
  ASSERT_EQ(after.Registered(), 10);
  EXPECT_EQ(after.evidence.pairs.size(), ring.capture.matches.size());
  EXPECT_EQ(after.matches.size(), ring.capture.matches.size());
  EXPECT_TRUE(sfm::LeftOutPictures(after).empty());
  EXPECT_TRUE(sfm::DropContradicted(ring.names, &after).empty());
  const sfm::PoseError error = sfm::ComparePoses(after.models.front().scene, ring.capture.truth);
  EXPECT_LT(error.rotation_max_deg, 0.2);
  EXPECT_LT(error.centre_rmse, 5e-3);
}

TEST(SecondLook, WhatDoesNotFitStaysOut) {
  REQUIRE_PROGRAM("colmap");
  const TempDir dir;
  Ring ring({5});
  const sfm::MappingAttempt before = ring.Map(dir / "before");
  ASSERT_EQ(before.Registered(), 9);
  ring.later.resize(3);                        // verifying what is wrong takes long
  for (sfm::PairMatches& pair : ring.later) {  // every match goes to another point
    for (std::size_t i = 0; i < pair.matches.size(); ++i)
      pair.matches[i][1] = pair.matches[(i + 7) % pair.matches.size()][1];
    for (std::size_t i = 0; i + 1 < pair.matches.size(); ++i)
      std::swap(pair.matches[i][1], pair.matches[i / 2][1]);
  }
  const sfm::MappingAttempt after = ring.Grow(before, dir / "after");
  EXPECT_EQ(after.Registered(), 9);
  EXPECT_EQ(after.largest, before.largest);
  EXPECT_EQ(sfm::LeftOutPictures(after), (std::vector<int>{5}));
  EXPECT_NE(after.database, before.database) << "its pairs say why the picture is missing";
}

TEST(SecondLook, APictureInAWrongPlaceIsTakenOutAgain) {
  REQUIRE_PROGRAM("colmap");
  const TempDir dir;
  const Ring ring({});
  sfm::MappingAttempt attempt = ring.Map(dir / "work");
  ASSERT_EQ(attempt.Registered(), 10);
  io::Scene& scene = attempt.models.front().scene;
  io::Frame& moved = scene.frames[4];
  moved.world_from_cam.translation += 0.5 * scene.frames[5].world_from_cam.rotation.col(1);
  const std::string name = moved.image_path.string();
  const std::size_t points = scene.points.size();
  EXPECT_TRUE(sfm::DropContradicted({"p0000.png", "p0001.png"}, &attempt).empty());
  EXPECT_EQ(sfm::DropContradicted({"p0000.png", name}, &attempt), Names{name});
  ASSERT_EQ(attempt.Registered(), 9);
  const io::ColmapModel& model = attempt.models.front();
  EXPECT_GT(model.scene.points.size(), points / 2);
  EXPECT_EQ(model.scene.cameras.size(), 1u);
  for (const io::Frame& frame : model.scene.frames) EXPECT_NE(frame.image_path.string(), name);
  for (const io::Observation& o : model.observations) {
    const io::Point3D& point = model.scene.points.at(static_cast<std::size_t>(o.point_index));
    EXPECT_EQ(std::count(point.frame_indices.begin(), point.frame_indices.end(), o.frame_index), 1);
  }
}

// On fewer than 30 points, by three pixels in a thousand, and by five times as much as others: each alone is
// right in some capture.
TEST(SecondLook, APoseIsUncertainByItselfAndBesideOthers) {
  const sfm::SyntheticCapture capture = sfm::MakeSyntheticCapture({.pictures = 10, .points = 200, .seed = 4});
  io::ColmapModel model;
  model.scene = capture.truth;
  const auto uncertain = [&](double usual, std::size_t at, double sigma, int n_points = 29) {
    model.observations.assign(static_cast<std::size_t>(n_points), {.frame_index = static_cast<int>(at)});
    sfm::BundleUncertainty uncertainty;
    uncertainty.poses.assign(10, {.rotation_deg = usual});
    uncertainty.poses[at].rotation_deg = sigma;
    Names names;
    for (const sfm::UncertainPicture& picture : sfm::UncertainPictures(model, uncertainty)) {
      EXPECT_EQ(picture.rotation_deg, sigma);
      EXPECT_EQ(picture.median_deg, usual);
      EXPECT_EQ(picture.n_points, n_points);
      names.push_back(picture.name);
    }
    return names;
  };
  const io::Camera& camera = model.scene.cameras[0];
  const double limit_deg = 0.003 * std::max(camera.width, camera.height) / camera.fl_x * 180 / M_PI;
  const std::string name = model.scene.frames[6].image_path.string();
  EXPECT_EQ(uncertain(limit_deg / 6, 6, 1.01 * limit_deg), Names{name});
  EXPECT_EQ(uncertain(limit_deg / 6, 6, 1.01 * limit_deg, 30), Names{});
  EXPECT_EQ(uncertain(limit_deg / 6, 6, 0.99 * limit_deg), Names{});
  EXPECT_EQ(uncertain(limit_deg / 4, 6, 1.01 * limit_deg), Names{});
  EXPECT_EQ(uncertain(limit_deg / 4, 6, std::numeric_limits<double>::infinity()), Names{name});
}

// A quarter of the usual number of points, with errors one and a half times as large: each alone is right in
// some capture. Errors count over what the feature's size lets expect.
TEST(SecondLook, FewPointsThatFitBadlyAreReflections) {
  const sfm::SyntheticCapture capture = sfm::MakeSyntheticCapture({.pictures = 10, .points = 200, .seed = 4});
  const auto misfits = [&](int n_points, double error_px, double sigma) {
    io::ColmapModel model;
    model.scene = capture.truth;
    for (int frame = 0; frame < 10; ++frame) {
      const bool odd = frame == 6;
      for (int point = 0; point < (odd ? n_points : 100); ++point) {
        io::Observation observation{.frame_index = frame, .point_index = point, .sigma = odd ? sigma : 1};
        observation.xy = io::Project(model.scene, observation).value();
        observation.xy.x() += odd ? error_px : 0.5;
        model.observations.push_back(observation);
      }
    }
    Names names;
    for (const sfm::MisfittingPicture& picture : sfm::MisfittingPictures(model)) {
      EXPECT_EQ(picture.n_points, n_points);
      EXPECT_NEAR(picture.error_px, error_px / sigma, 1e-9);
      EXPECT_NEAR(picture.median_px, 0.5, 1e-9);
      names.push_back(picture.name);
    }
    return names;
  };
  const std::string name = capture.truth.frames[6].image_path.string();
  EXPECT_EQ(misfits(24, 0.76, 1), Names{name});
  EXPECT_EQ(misfits(25, 0.76, 1), Names{});
  EXPECT_EQ(misfits(24, 0.74, 1), Names{});
  EXPECT_EQ(misfits(24, 0.76, 2), Names{});
  EXPECT_EQ(misfits(24, 1.52, 2), Names{name});
  EXPECT_TRUE(sfm::MisfittingPictures({}).empty());
}

TEST(SecondLook, WithoutAPictureNothingOfItIsLeft) {
  io::ColmapModel model;
  for (const int width : {100, 200, 300}) model.scene.cameras.push_back({.width = width});
  const std::vector<std::pair<const char*, int>> frames = {{"a", 0}, {"b", 1}, {"c", 2}, {"d", 2}};
  for (const auto& [name, camera] : frames)
    model.scene.frames.push_back({.image_path = name, .camera_index = camera});
  // Seen by one other picture; by two; not by it; and twice by one other.
  for (const std::vector<int>& seen_by : {Indices{0, 1}, {1, 2, 3}, {0, 2}, {0, 0, 1}}) {
    const auto point = static_cast<int>(model.scene.points.size());
    model.scene.points.push_back({.xyz = Eigen::Vector3d(point, 0, 0), .frame_indices = seen_by});
    for (const int frame : seen_by)
      model.observations.push_back({.frame_index = frame, .point_index = point, .xy = {frame, point}});
  }
  const io::ColmapModel left = sfm::WithoutFrames(model, {"b"});
  Names names;
  Indices widths;
  for (const io::Frame& frame : left.scene.frames) {
    names.push_back(frame.image_path.string());
    widths.push_back(left.scene.cameras.at(static_cast<std::size_t>(frame.camera_index)).width);
  }
  EXPECT_EQ(names, (Names{"a", "c", "d"}));
  EXPECT_EQ(widths, (Indices{100, 300, 300}));
  EXPECT_EQ(left.scene.cameras.size(), 2u);
  ASSERT_EQ(left.scene.points.size(), 2u);
  EXPECT_EQ(left.scene.points[0].xyz.x(), 1);
  EXPECT_EQ(left.scene.points[0].frame_indices, (Indices{1, 2}));
  EXPECT_EQ(left.scene.points[1].xyz.x(), 2);
  EXPECT_EQ(left.scene.points[1].frame_indices, (Indices{0, 1}));
  EXPECT_EQ(left.observations,
            (std::vector<io::Observation>{{.frame_index = 1, .point_index = 0, .xy = {2, 1}},
                                          {.frame_index = 2, .point_index = 0, .xy = {3, 1}},
                                          {.frame_index = 0, .point_index = 1, .xy = {0, 2}},
                                          {.frame_index = 1, .point_index = 1, .xy = {2, 2}}}));
}

TEST(SecondLook, CostsAreCountedInComparisons) {
  EXPECT_EQ(sfm::PairsWith({1, 3}, 4), (sfm::ImagePairs{{0, 1}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}));
  std::vector<sfm::Features> features(4);
  for (std::size_t i = 0; i < 4; ++i) features[i].keypoints.resize(10 * (i + 1));
  EXPECT_EQ(sfm::Comparisons(features, {{0, 1}, {2, 3}}), 10 * 20 + 30 * 40);
  // One picture costs 100 features in all times 50.
  EXPECT_EQ(sfm::WithinCeiling({3, 1, 0}, features, 50, 4999), std::vector<int>{});
  EXPECT_EQ(sfm::WithinCeiling({3, 1, 0}, features, 50, 10000), (std::vector<int>{3, 1}));
  EXPECT_EQ(sfm::WithinCeiling({3, 1, 0}, features, 50, 1e9), (std::vector<int>{3, 1, 0}));
}

}  // namespace
