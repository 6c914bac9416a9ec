// What the driver makes of a COLMAP that is missing, crashes, hangs, or lies: a stand-in `colmap` on PATH
// plays each.
#include "sfm/colmap/colmap.h"

#include <random>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/image/image.h"
#include "io/process/process.h"
#include "tests/support/programs/require_program.h"
#include "tests/support/programs/stand_in_colmap.h"

namespace {

namespace fs = std::filesystem;

class ColmapDriver : public StandInColmap {
 protected:
  sfm::Colmap Make() { return {folder_ / "work", 1}; }

  std::vector<sfm::Features> Extract(sfm::Colmap* colmap) {
    return colmap->ExtractFeatures(
        folder_ / "images", {{.names = {"a.png"}, .width = 640, .height = 480}}, {"a.png"}, {});
  }

  template <typename Action>
  static std::string ErrorOf(const Action& action, io::ExitCode code) {
    try {
      action();
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      return error.what();
    }
    ADD_FAILURE() << "no error";
    return "";
  }
};

TEST_F(ColmapDriver, MissingProgramNamesTheRemedy) {
  setenv("PATH", folder_.c_str(), 1);
  EXPECT_NE(ErrorOf([&] { Make(); }, io::ExitCode::kMissingTool).find("apt-get install colmap"),
            std::string::npos);
}

TEST_F(ColmapDriver, ACrashIsReportedWithTheLastLines) {
  Install("echo the last words; kill -SEGV $$");
  sfm::Colmap colmap = Make();
  const std::string message = ErrorOf([&] { colmap.Map("", 5); }, io::ExitCode::kMissingTool);
  EXPECT_NE(message.find("mapper"), std::string::npos) << message;
  EXPECT_NE(message.find("signal 11"), std::string::npos) << message;
  EXPECT_NE(message.find("the last words"), std::string::npos) << message;
}

TEST_F(ColmapDriver, OneThatCrashesWhenAskedForHelpIsNamed) {
  const fs::path program = folder_ / "colmap";
  std::ofstream(program) << "#!/bin/sh\nkill -SEGV $$\n";
  fs::permissions(program, fs::perms::owner_all);
  EXPECT_NE(ErrorOf([&] { Make(); }, io::ExitCode::kMissingTool).find("-h' crashed"), std::string::npos);
}

// Or products of its matrix library would depend on the number of cores.
TEST_F(ColmapDriver, ItWorksWithOneThreadOnAnyNumberOfCores) {
  Install("echo threads: $OMP_NUM_THREADS; kill -SEGV $$");
  sfm::Colmap colmap = Make();
  const std::string message = ErrorOf([&] { colmap.Map("", 5); }, io::ExitCode::kMissingTool);
  EXPECT_NE(message.find("threads: 1\n"), std::string::npos) << message;
}

TEST_F(ColmapDriver, LackOfMemoryIsNoFaultOfTheProgram) {
  Install("echo \"terminate called after throwing an instance of 'std::bad_alloc'\"; kill -ABRT $$");
  sfm::Colmap colmap = Make();
  const std::string message = ErrorOf([&] { colmap.Map("", 5); }, io::ExitCode::kNoResources);
  EXPECT_NE(message.find("mapper"), std::string::npos) << message;
  EXPECT_NE(message.find("memory"), std::string::npos) << message;
}

TEST_F(ColmapDriver, NoModelIsAnAnswer) {
  Install("echo failed to create sparse model; exit 1");
  sfm::Colmap colmap = Make();
  EXPECT_TRUE(colmap.Map("", 5).empty());
}

TEST_F(ColmapDriver, NoPointsAreAnAnswerAndOtherAbortsAreNot) {
  Install("echo 'sfm.cc:473] Check failed: bundle_adjuster.Solve(&reconstruction)'; kill -ABRT $$");
  sfm::Colmap colmap = Make();
  EXPECT_FALSE(colmap.Triangulate("", folder_, 5));
  Install("echo 'Check failed: something else'; kill -ABRT $$");
  EXPECT_NE(ErrorOf([&] { colmap.Triangulate("", folder_, 5); }, io::ExitCode::kMissingTool).find("signal 6"),
            std::string::npos);
}

// Of blocks that are mapped side by side one would be missing.
TEST_F(ColmapDriver, ADatabaseThatAnotherProcessIsOpeningIsOpenedAgain) {
  const fs::path tries = folder_ / "tries";
  Install("echo x >> " + tries.string() + "; [ $(wc -l < " + tries.string() +
          ") -gt 3 ] || { echo 'SQLite error [database.cc, line 1361]: database is locked'; exit 1; }\n" +
          "mkdir " + (folder_ / "work/sparse/0").string());
  sfm::Colmap colmap = Make();
  EXPECT_EQ(colmap.Map("", 5).size(), 1u);
  EXPECT_EQ(io::ReadFile(tries).size(), 8u);  // "x" and an end of line, four times
}

TEST_F(ColmapDriver, ADatabaseThatStaysLockedIsNoAnswer) {
  Install("echo database is locked; exit 1");
  sfm::Colmap colmap = Make();
  EXPECT_NE(ErrorOf([&] { colmap.Map("", 5); }, io::ExitCode::kMissingTool).find("is locked"),
            std::string::npos);
}

TEST_F(ColmapDriver, ModelsThatCannotBeMergedAreNoFailure) {
  for (const char* body : {"exit 1", "exit 0"}) {
    Install(body);
    sfm::Colmap colmap = Make();
    EXPECT_FALSE(colmap.Merge(folder_ / "0", folder_ / "1")) << body;
  }
}

TEST_F(ColmapDriver, ExtractionWithoutADatabaseIsNotBelieved) {
  Install("exit 0");
  sfm::Colmap colmap = Make();
  ErrorOf([&] { Extract(&colmap); }, io::ExitCode::kBadState);
}

TEST_F(ColmapDriver, VerificationWithoutADatabaseIsNotBelieved) {
  Install("exit 0");
  sfm::Colmap colmap = Make();
  sfm::CapturedViews views{.names = {"a.png", "b.png"}, .features = std::vector<sfm::Features>(2)};
  views.groups = {{.names = views.names, .width = 640, .height = 480}};
  ErrorOf([&] { colmap.VerifyMatches(views, {{.a = 0, .b = 1}}); }, io::ExitCode::kBadState);
}

TEST_F(ColmapDriver, ExtractionThatSkipsPicturesIsNotBelieved) {
  fs::create_directories(folder_ / "images");
  std::ofstream(folder_ / "images" / "a.png") << "not a picture";
  setenv("PATH", old_path_.c_str(), 1);
  REQUIRE_PROGRAM("colmap");
  sfm::Colmap colmap = Make();
  const std::string message = ErrorOf([&] { Extract(&colmap); }, io::ExitCode::kMissingTool);
  EXPECT_NE(message.find("skipped a.png"), std::string::npos) << message;
}

TEST_F(ColmapDriver, NoMoreFeaturesThanAskedForAreKept) {
  setenv("PATH", old_path_.c_str(), 1);
  REQUIRE_PROGRAM("colmap");
  io::Image image = io::MakeImage(320, 240, 3);
  std::mt19937 random(1);
  for (std::uint8_t& value : image.data) value = static_cast<std::uint8_t>(random());
  fs::create_directories(folder_ / "images");
  io::WriteImage(folder_ / "images" / "a.png", image);
  sfm::Colmap colmap = Make();
  const auto features = colmap.ExtractFeatures(folder_ / "images",
                                               {{.names = {"a.png"}, .width = 320, .height = 240}},
                                               {"a.png"},
                                               {.max_features = 100});
  EXPECT_EQ(features[0].keypoints.size(), 100u);
  EXPECT_EQ(features[0].descriptors.size(), 100u * sfm::kDescriptorBytes);
}

TEST_F(ColmapDriver, ArgumentsAreThoseOfTheInstalledVersion) {
  Install("echo \"$@\" >> " + (folder_ / "calls").string());
  sfm::Colmap colmap = Make();
  EXPECT_THROW(Extract(&colmap), io::Error);
  colmap.Map(folder_, 5, true);
  std::ifstream in(folder_ / "calls");
  const std::string calls(std::istreambuf_iterator<char>(in), {});
  EXPECT_NE(calls.find("--SiftExtraction.use_gpu 0"), std::string::npos) << calls;
  EXPECT_NE(calls.find("--Mapper.num_threads 1"), std::string::npos) << calls;
  EXPECT_NE(calls.find("--Mapper.init_min_tri_angle 8"), std::string::npos) << calls;
  EXPECT_EQ(calls.find("--Mapper.ba_global"), std::string::npos) << "not listed in this help: " << calls;
}

}  // namespace
