// Small rendered captures through the installed COLMAP: a walk is reconstructed to its true poses, a camera
// that only turns is refused by name.
#include "sfm/reconstruction.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>

#include "io/base/error.h"
#include "io/image/mask.h"
#include "io/process/process.h"
#include "tests/support/files/small_capture.h"
#include "tests/support/programs/forked_ranks.h"
#include "tests/support/programs/require_program.h"
#include "tests/support/scenes/scene_matchers.h"

namespace {

namespace fs = std::filesystem;
using sfm::RefusalCause;

TEST_F(SmallCapture, AWalkIsReconstructedToItsTruePoses) {
  REQUIRE_PROGRAM("colmap");
  for (int i = 0; i < 7; ++i) {
    const double angle = 0.14 * i;
    Add(LookAt(
        {1.6 * std::sin(angle), 0.2 * std::sin(5 * angle), 1.6 * std::cos(angle)}, {0, 0, 0}, {0, 1, 0}));
  }
  const sfm::Reconstruction result = Run();
  const io::Scene& scene = result.model.scene;
  ASSERT_EQ(scene.frames.size(), 7u);
  EXPECT_TRUE(result.unregistered.empty());
  EXPECT_GT(scene.points.size(), 100u);
  EXPECT_LT(result.model.mean_reprojection_error_px, 1.0);
  EXPECT_GT(result.triangulation_angle_deg, 5);
  EXPECT_TRUE(fs::exists(result.database));
  EXPECT_EQ(Decided("trying again"), 0);
  // Weighted by the size of the features, all of which are found again.
  EXPECT_LT(std::count_if(result.model.observations.begin(),
                          result.model.observations.end(),
                          [](const io::Observation& o) { return o.sigma == 1; }),
            0.1 * static_cast<double>(result.model.observations.size()));
  // The world is free up to a similarity: compare rotations, and ratios of distances, between pictures.
  const auto& frames = scene.frames;
  const double scale = (truth_[6].translation - truth_[0].translation).norm() /
                       (frames[6].world_from_cam.translation - frames[0].world_from_cam.translation).norm();
  for (std::size_t i = 1; i < 7; ++i) {
    const Eigen::Matrix3d estimated =
        frames[0].world_from_cam.rotation.transpose() * frames[i].world_from_cam.rotation;
    const Eigen::Matrix3d expected = truth_[0].rotation.transpose() * truth_[i].rotation;
    EXPECT_LT(Eigen::AngleAxisd(estimated.transpose() * expected).angle() * 180 / EIGEN_PI, 0.5) << i;
    EXPECT_NEAR((frames[0].world_from_cam.Inverse() * frames[i].world_from_cam.translation * scale -
                 truth_[0].Inverse() * truth_[i].translation)
                    .norm(),
                0,
                0.03)
        << i;
  }
}

TEST_F(SmallCapture, TheNumberOfThreadsChangesNoBit) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(5);
  const sfm::Reconstruction one = Run({.features = 600, .threads = 1});
  fs::remove_all(folder_ / "work");
  const sfm::Reconstruction three = Run({.features = 600, .threads = 3});
  const auto &a = one.model.scene, &b = three.model.scene;
  ASSERT_EQ(a.frames.size(), 5u);
  ASSERT_EQ(b.frames.size(), 5u);
  EXPECT_EQ(a.cameras, b.cameras);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(a.frames[i].world_from_cam.rotation, b.frames[i].world_from_cam.rotation) << i;
    EXPECT_EQ(a.frames[i].world_from_cam.translation, b.frames[i].world_from_cam.translation) << i;
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) ASSERT_EQ(a.points[i].xyz, b.points[i].xyz) << i;
}

TEST_F(SmallCapture, AStrongerAttemptIsMadeAndItsReasonGiven) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(5);
  AddStranger("stranger.png");
  const sfm::Reconstruction result = Run();
  ASSERT_EQ(result.unregistered.size(), 1u);
  EXPECT_EQ(result.unregistered[0].name, "stranger.png");
  EXPECT_EQ(result.unregistered[0].refusal.cause, RefusalCause::kNoOverlap)
      << result.unregistered[0].refusal.Summary();
  EXPECT_EQ(Decided("trying again with a relaxed start"), 1);
  EXPECT_EQ(Decided("trying again with up to 8192 features"), 1);
  EXPECT_EQ(result.database.parent_path().filename(), "attempt1") << "none of the others was better";
  EXPECT_GT(fs::file_size(folder_ / "work" / "attempt3" / "database.db"), fs::file_size(result.database))
      << "more features";
}

const sfm::ReconstructionOptions kSmallBlocks = {
    .features = 600, .whole_pictures = 6, .blocks = {.pictures = 4, .overlap = 0.25}, .threads = 2};

TEST_F(SmallCapture, ABlockThatCannotBeJoinedIsContinuedWithThePicturesOfTheOthers) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(7);
  EXPECT_EQ(Run(kSmallBlocks).model.scene.frames.size(), 7u);
  EXPECT_EQ(Decided("3 models, 1 of them joined"), 1) << "they share one picture each";
  EXPECT_EQ(Decided("trying again"), 0);
}

TEST_F(SmallCapture, TwoRanksFindThePosesOfOne) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(7);
  const sfm::Reconstruction one = Run(kSmallBlocks);
  fs::remove_all(folder_ / "work");
  sfm::Reconstruction two;
  const auto lead = [&] {
    const io::HelpOfOthers help;
    two = Run(kSmallBlocks);
  };
  const auto follow = [&] {
    io::ToldWorks works;
    sfm::AddReconstructionWorks(folder_ / "images", folder_ / "work", kSmallBlocks, &works);
    io::Help(works);
  };
  EXPECT_EQ(OnTwoRanks(lead, follow), 0);
  EXPECT_TRUE(fs::exists(folder_ / "work/attempt1/rank1/block1")) << "it had a part";
  EXPECT_THAT(two.model.scene, tests::SceneNear(one.model.scene, 0));
}

TEST_F(SmallCapture, WhatBlocksDoNotGiveIsMappedAsAWhole) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(7);
  const fs::path colmap = *io::FindProgram("colmap"), stand_in = folder_ / "colmap";
  std::ofstream(stand_in) << "#!/bin/sh\nfor a; do [ \"$a\" = --image_list_path ] && exit 1; done\nexec " +
                                 colmap.string() + " \"$@\"\n";
  fs::permissions(stand_in, fs::perms::owner_all);
  const std::string path = std::getenv("PATH");
  setenv("PATH", (folder_.string() + ":" + path).c_str(), 1);
  const sfm::Reconstruction result = Run(kSmallBlocks);
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(result.model.scene.frames.size(), 7u);
  EXPECT_EQ(Decided("only 0 of 7 pictures registered; trying again with all pictures as a whole"), 1);
  EXPECT_EQ(Decided("trying again"), 1);
}

TEST_F(SmallCapture, AttemptsBeyondTheCeilingOfTimeAreNotMade) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(4);
  AddStranger("stranger.png");
  EXPECT_EQ(Run({.features = 600, .retry_minutes = 1e-6, .threads = 2}).unregistered.size(), 1u);
  EXPECT_EQ(Decided("trying again"), 0);
  EXPECT_EQ(Decided("not tried: a relaxed start"), 1);
}

// COLMAP orders its features by size, so that those of a later attempt with more of them have other numbers.
TEST_F(SmallCapture, AnEarlierAttemptIsJudgedByItsOwnKeypoints) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(5);
  AddStranger("stranger.png");
  const sfm::Reconstruction result = Run({.detector = "colmap", .features = 1000, .threads = 2});
  EXPECT_EQ(result.database.parent_path().filename(), "attempt1");
  EXPECT_EQ(Decided("trying again with up to 8192 features"), 1);
  EXPECT_EQ(Decided("contradict"), 0);
  // Every observation has found its keypoint; 1 is the sigma of the median only.
  const auto& observations = result.model.observations;
  EXPECT_LT(
      std::count_if(
          observations.begin(), observations.end(), [](const io::Observation& o) { return o.sigma == 1; }),
      0.1 * static_cast<double>(observations.size()));
}

TEST_F(SmallCapture, ACameraThatOnlyTurnsHasNoBaseline) {
  REQUIRE_PROGRAM("colmap");
  for (int i = 0; i < 7; ++i) {
    const double angle = 0.1 * i;
    const Eigen::Vector3d eye(0.2, 0.1, 1.6);
    const Eigen::Vector3d back(std::sin(angle), 0.3 * std::sin(3 * angle), std::cos(angle));
    Add(LookAt(eye, eye - back, {0, 1, 0}));
  }
  EXPECT_EQ(RefusalOf([&] { Run(); }).cause, RefusalCause::kRotationOnly);
  EXPECT_EQ(Decided("trying again"), 0) << "stronger settings do not move the camera";
}

TEST_F(SmallCapture, AFragmentIsRefused) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(4);
  for (const char* name : {"x.png", "y.png", "z.png"}) AddStranger(name);
  const sfm::Refusal refusal = RefusalOf([&] { Run({.features = 600, .retry_minutes = 0, .threads = 2}); });
  EXPECT_EQ(refusal.cause, RefusalCause::kNoOverlap);
  EXPECT_NE(refusal.figures.find("4 of 7 pictures"), std::string::npos) << refusal.figures;
  EXPECT_EQ(Decided("tried"), 0);
}

TEST_F(SmallCapture, NothingBehindAMaskIsUsed) {
  REQUIRE_PROGRAM("colmap");
  AddWalk(4);
  io::Mask mask{kWidth, kHeight, std::vector<std::uint8_t>(kWidth * kHeight)};
  for (std::size_t p = 0; p < mask.used.size(); ++p) mask.used[p] = p % kWidth < 100 ? 0 : 255;
  fs::create_directories(folder_ / "masks");
  for (const sfm::Picture& picture : pictures_) io::WriteMask(folder_ / "masks" / picture.name, mask);
  const sfm::Reconstruction result = Run({.features = 600, .masks_folder = folder_ / "masks", .threads = 2});
  ASSERT_EQ(result.model.scene.frames.size(), 4u);
  for (const io::Observation& o : result.model.observations) EXPECT_GT(o.xy.x(), 99);
}

// Without features, only the order of the pictures says which are matched.
TEST_F(SmallCapture, PairsAreChosenByNumberAndKind) {
  REQUIRE_PROGRAM("colmap");
  const auto decide = [&](int n, bool video, const std::string& matching) {
    pictures_.clear();
    fs::remove_all(folder_ / "work");
    AddBlank(n, video);
    const sfm::Refusal refusal = RefusalOf([&] { Run({.features = 600, .matching = matching}); });
    EXPECT_EQ(refusal.cause, RefusalCause::kNoTexture);
    return decisions_.back();
  };
  EXPECT_EQ(decide(30, false, "auto"), "matching all 435 pairs of 30 pictures");
  EXPECT_EQ(decide(31, false, "auto").substr(0, 38), "matching 59 of 465 pairs: the most ali");
  EXPECT_EQ(decide(31, true, "auto").substr(0, 38), "matching 212 of 465 pairs: following f");
  EXPECT_EQ(decide(31, true, "exhaustive"), "matching all 465 pairs of 31 pictures");
}

TEST_F(SmallCapture, BlankPicturesHaveNoTexture) {
  REQUIRE_PROGRAM("colmap");
  AddBlank(3);
  EXPECT_EQ(RefusalOf([&] { Run(); }).cause, RefusalCause::kNoTexture);
}

TEST_F(SmallCapture, TwoPicturesAreTooFew) {
  pictures_ = {{.name = "a.png"}, {.name = "b.png"}};
  const sfm::Refusal refusal = RefusalOf([&] { Run(); });
  EXPECT_EQ(refusal.cause, RefusalCause::kTooFewPictures);
  EXPECT_EQ(refusal.figures, "2");
}

TEST(FeaturesFor, ManyPicturesNeedFewerEach) {
  const auto features = [](std::size_t n_pictures) { return sfm::FeaturesFor(n_pictures); };
  EXPECT_EQ(features(3), 4096);
  EXPECT_EQ(features(400), 4096);
  EXPECT_EQ(features(600), 2730);
  EXPECT_EQ(features(800), 2048);
  EXPECT_EQ(features(5000), 2048);
}

TEST_F(SmallCapture, UnknownOptionsAreUsageErrors) {
  for (const sfm::ReconstructionOptions& options : {sfm::ReconstructionOptions{.camera_model = "FISHEYE"},
                                                    sfm::ReconstructionOptions{.matching = "magic"},
                                                    sfm::ReconstructionOptions{.detector = "orb"},
                                                    sfm::ReconstructionOptions{.features = 5}}) {
    try {
      Run(options);
      FAIL();
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), io::ExitCode::kUsage);
    }
  }
}

}  // namespace
