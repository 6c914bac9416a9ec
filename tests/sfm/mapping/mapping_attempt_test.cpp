// What becomes of the models that COLMAP leaves behind, and what it is given. A stand-in `colmap` delivers
// models made here.
#include "sfm/mapping/mapping_attempt.h"

#include "io/base/error.h"
#include "tests/support/files/colmap_tables.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/stand_in_colmap.h"
#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

namespace fs = std::filesystem;

constexpr int kPictures = 9;

// Pictures [first, end) of a ring.
io::ColmapModel Part(int first, int end, double noise_px = 0.5) {
  io::ColmapModel model = Ring(kPictures, SmallCamera());
  std::vector<io::Frame>& frames = model.scene.frames;
  for (std::size_t i = 0; i < kPictures; ++i) frames[i].image_path = "p" + std::to_string(i) + ".png";
  frames.erase(frames.begin() + end, frames.end());
  frames.erase(frames.begin(), frames.begin() + first);
  std::mt19937_64 random(3);
  for (int i = 0; i < 200; ++i) AddPoint(&model, RandomVector(&random, 1), noise_px, &random);
  return model;
}

sfm::Features SomeFeatures() {
  sfm::Features features;
  for (int i = 0; i < 15; ++i)
    features.keypoints.push_back({static_cast<float>(40 * i), static_cast<float>(i * i % 7 * 60)});
  return features;
}

class Mapping : public StandInColmap {
 protected:
  // models: what the mapper finds; merged: what the merger makes of two of them.
  sfm::MappingAttempt Attempt(const std::vector<io::ColmapModel>& models,
                              const io::ColmapModel& merged,
                              std::vector<sfm::PairMatches> matches = {}) {
    for (const char* name : {"models", "merged", "work"}) fs::remove_all(folder_ / name);
    for (std::size_t i = 0; i < models.size(); ++i) Write("models/" + std::to_string(i), models[i]);
    Write("merged", merged);
    fs::remove(folder_ / "empty.db");
    CreateDatabase(folder_ / "empty.db", false);
    const std::string f = folder_.string();
    Install("cd " + f +
            "\n"
            "case $1 in\n"
            "  database_creator) cp empty.db \"$3\";;\n"
            "  mapper) cp -r models/* \"$7\";;\n"
            "  model_merger) cp merged/* \"$7\"; touch was_merged;;\n"
            "esac");
    fs::remove(folder_ / "was_merged");
    std::vector<sfm::Picture> pictures;
    for (int i = 0; i < kPictures; ++i) {
      pictures.push_back({.name = "p" + std::to_string(i) + ".png", .width = 640, .height = 480});
    }
    views_ = std::make_shared<sfm::CapturedViews>(
        sfm::CapturedViews{.names = sfm::Names(pictures),
                           .groups = sfm::CameraGroups(pictures),
                           .features = std::vector<sfm::Features>(kPictures, SomeFeatures())});
    return sfm::Attempt(pictures, views_, std::move(matches), "", folder_ / "work", {});
  }

  std::vector<std::size_t> Sizes(const std::vector<io::ColmapModel>& models, const io::ColmapModel& merged) {
    std::vector<std::size_t> sizes;
    for (const io::ColmapModel& model : Attempt(models, merged).models) {
      sizes.push_back(model.scene.frames.size());
    }
    return sizes;
  }

  bool WasMerged() const { return fs::exists(folder_ / "was_merged"); }

  std::shared_ptr<const sfm::CapturedViews> views_;

 private:
  void Write(const std::string& name, const io::ColmapModel& model) {
    fs::create_directories(folder_ / name);
    io::WriteColmapModel(folder_ / name, model);
  }
};

using SizeList = std::vector<std::size_t>;

TEST_F(Mapping, TheLargestModelComesFirst) {
  EXPECT_EQ(Sizes({Part(0, 4), Part(4, 9), Part(3, 6)}, Part(0, 9)), (SizeList{5, 4, 3}));
  EXPECT_FALSE(WasMerged()) << "models that share at most 2 pictures";
}

TEST_F(Mapping, ModelsThatShareThreePicturesAreMerged) {
  EXPECT_EQ(Sizes({Part(0, 4), Part(1, 6)}, Part(0, 6)), (SizeList{6}));
  EXPECT_TRUE(WasMerged());
  EXPECT_EQ(Sizes({Part(0, 5), Part(2, 6)}, Part(0, 5)), (SizeList{5, 4})) << "nothing gained";
  EXPECT_TRUE(WasMerged());
}

TEST_F(Mapping, AMergedModelMustFitAboutAsWellAsTheWorse) {
  EXPECT_EQ(Sizes({Part(0, 5, 0.3), Part(2, 6, 0.6)}, Part(0, 6, 0.6)), (SizeList{6}));
  EXPECT_EQ(Sizes({Part(0, 5, 0.6), Part(2, 6, 0.3)}, Part(0, 6, 0.6)), (SizeList{6}));
  EXPECT_EQ(Sizes({Part(0, 5, 0.6), Part(2, 6, 0.3)}, Part(0, 6, 0.75)), (SizeList{5, 4}));
}

TEST_F(Mapping, ModelsOfOtherPicturesAreNotBelieved) {
  io::ColmapModel other = Part(0, 4);
  other.scene.frames[3].image_path = "stranger.png";
  EXPECT_ERROR(Attempt({other}, other), io::ExitCode::kMissingTool, "stranger.png");
  other = Part(0, 4);
  other.scene.cameras[0].width = 480;
  other.scene.cameras[0].height = 640;
  EXPECT_ERROR(Attempt({other}, other), io::ExitCode::kMissingTool, "p0.png", "another size");
}

// Pairs with too few matches are not verified, but an attempt keeps all that it was made from.
TEST_F(Mapping, AnAttemptKeepsWhatItWasMadeFrom) {
  std::vector<sfm::PairMatches> matches = {{.a = 0, .b = 1, .matches = {}}, {.a = 0, .b = 2, .matches = {}}};
  for (int i = 0; i < 15; ++i) {
    if (i < 14) matches[0].matches.push_back({i, i});
    matches[1].matches.push_back({i, i});
  }
  const sfm::MappingAttempt attempt = Attempt({Part(0, 4)}, Part(0, 4), matches);
  EXPECT_EQ(attempt.views, views_);
  ASSERT_EQ(attempt.matches.size(), 2u);
  EXPECT_EQ(attempt.matches[0].matches.size(), 14u);
  EXPECT_EQ(attempt.Registered(), 4);
  ASSERT_EQ(attempt.evidence.pairs.size(), 1u);
  EXPECT_EQ(attempt.evidence.pairs[0].name_a + attempt.evidence.pairs[0].name_b, "p0.pngp2.png");
  EXPECT_EQ(attempt.evidence.pairs[0].matches, matches[1].matches);
  // Both pictures show the points at the same places.
  EXPECT_EQ(attempt.evidence.pairs[0].geometry, sfm::PairGeometry::kRotation);
}

TEST_F(Mapping, NoModelIsAnAttemptToo) { EXPECT_EQ(Attempt({}, Part(0, 4)).Registered(), 0); }

TEST(CameraGroups, ShareACameraByGroupAndSize) {
  const auto groups = sfm::CameraGroups({{"a.png", 60, 40, 50, "x"},
                                         {"b.png", 60, 40, 0, "x"},
                                         {"c.png", 40, 60, 70, "x"},
                                         {"d.png", 60, 40, 90, "y"},
                                         {"e.png", 60, 40, 70, "x"},
                                         {"f.png", 60, 40, 0, "x"},
                                         {"g.png", 30, 30, 0, "y"}});
  ASSERT_EQ(groups.size(), 4u);
  const sfm::CameraGroup &turned = groups[0], &most = groups[1];
  EXPECT_EQ(turned.names, (std::vector<std::string>{"c.png"}));
  EXPECT_EQ(turned.height, 60);
  EXPECT_EQ(most.names, (std::vector<std::string>{"a.png", "b.png", "e.png", "f.png"}));
  EXPECT_EQ(most.width, 60);
  EXPECT_EQ(most.focal_px, 70) << "the upper median of those that are known";
  EXPECT_EQ(groups[2].focal_px, 0);
  EXPECT_EQ(groups[3].focal_px, 90);
}

}  // namespace
