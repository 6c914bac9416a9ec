// Which pictures are held out: every n-th, or one side of the capture.
#include "pipeline/evaluation/heldout_split.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace {

using Eigen::AngleAxisd, Eigen::Vector3d;

// On a circle of radius 4 around the z axis, looking at it; frame i stands at i n-ths of a turn.
std::vector<io::Frame> Circle(int n) {
  std::vector<io::Frame> frames(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    io::Rigid3d& pose = frames[static_cast<std::size_t>(i)].world_from_cam;
    pose.rotation = (AngleAxisd(2 * std::numbers::pi * i / n, Vector3d::UnitZ()) *
                     AngleAxisd(std::numbers::pi / 2, Vector3d::UnitX()))
                        .toRotationMatrix();
    pose.translation = 4 * (pose.rotation * Vector3d::UnitZ());
  }
  return frames;
}

std::vector<int> Indices(const std::vector<bool>& is_held_out) {
  std::vector<int> indices;
  for (std::size_t i = 0; i < is_held_out.size(); ++i)
    if (is_held_out[i]) indices.push_back(static_cast<int>(i));
  return indices;
}

TEST(HeldOutFrames, EveryNthFromTheFirst) {
  EXPECT_EQ(Indices(pipeline::HeldOutFrames(Circle(20), "every", 8)), (std::vector<int>{0, 8, 16}));
}

TEST(HeldOutFrames, ViewsOfAPanoramaAreHeldOutTogether) {
  // Those of one direction follow those of another.
  std::vector<io::Frame> frames = Circle(10);
  const std::vector<io::Frame> places = frames;
  for (io::Frame frame : places) {
    frame.world_from_cam.rotation = frame.world_from_cam.rotation * AngleAxisd(1, Vector3d::UnitY());
    frames.push_back(frame);
  }
  EXPECT_EQ(Indices(pipeline::HeldOutFrames(frames, "every", 8)), (std::vector<int>{0, 8, 10, 18}));
  // Two places: to leave one out would be half of the capture.
  for (std::size_t i = 0; i < frames.size(); ++i)
    frames[i].world_from_cam.translation = places[i % 2].world_from_cam.translation;
  EXPECT_EQ(Indices(pipeline::HeldOutFrames(frames, "every", 8)), (std::vector<int>{0, 8, 16}));
}

TEST(HeldOutFrames, ASectorIsOneSideAroundTheMiddlePicture) {
  EXPECT_EQ(Indices(pipeline::HeldOutFrames(Circle(24), "sector", 8)), (std::vector<int>{11, 12, 13}));
  // Places decide, not the order of names.
  std::vector<io::Frame> frames = Circle(24);
  std::swap(frames[11], frames[2]);
  EXPECT_EQ(Indices(pipeline::HeldOutFrames(frames, "sector", 8)), (std::vector<int>{2, 12, 13}));
}

TEST(HeldOutFrames, OnOneSpotDirectionsAloneCount) {
  std::vector<io::Frame> frames = Circle(24);
  for (io::Frame& frame : frames) frame.world_from_cam.translation.setZero();
  EXPECT_EQ(Indices(pipeline::HeldOutFrames(frames, "sector", 8)), (std::vector<int>{11, 12, 13}));
}

TEST(HeldOutFrames, NoFramesNoSplit) { EXPECT_TRUE(pipeline::HeldOutFrames({}, "sector", 8).empty()); }

TEST(SetAside, TakesFramesAndWhatTheyObserved) {
  io::Scene scene;
  scene.frames = Circle(7);
  scene.points.push_back({.xyz = {1, 0, 0}, .frame_indices = {0, 2, 6}});
  scene.points.push_back({.xyz = {2, 0, 0}, .frame_indices = {2, 5}});
  const std::vector<io::Frame> frames = scene.frames;
  const io::Scene aside = pipeline::SetAside(3, &scene);
  ASSERT_EQ(aside.frames.size(), 2u);
  EXPECT_EQ(aside.frames[0].world_from_cam.translation, frames[2].world_from_cam.translation);
  EXPECT_EQ(aside.frames[1].world_from_cam.translation, frames[5].world_from_cam.translation);
  EXPECT_TRUE(aside.points.empty());
  ASSERT_EQ(scene.frames.size(), 5u);
  EXPECT_EQ(scene.frames[4].world_from_cam.translation, frames[6].world_from_cam.translation);
  ASSERT_EQ(scene.points.size(), 1u) << "nobody is left who saw the other";
  EXPECT_EQ(scene.points[0].frame_indices, (std::vector<int>{0, 4}));
}

}  // namespace
