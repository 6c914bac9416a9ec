// What the driver makes of a COLMAP that is missing, crashes, hangs, or lies: a stand-in `colmap` on PATH
// plays each.
#include "sfm/colmap.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "io/error.h"

namespace {

namespace fs = std::filesystem;

class StandInColmap : public testing::Test {
 protected:
  StandInColmap() {
    std::string name = (fs::temp_directory_path() / "colmap_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    old_path_ = std::getenv("PATH");
    setenv("PATH", (folder_.string() + ":/usr/bin:/bin").c_str(), 1);
  }
  ~StandInColmap() override {
    setenv("PATH", old_path_.c_str(), 1);
    fs::remove_all(folder_);
  }

  // body: what every command except `-h` does.
  void Install(const std::string& body) {
    const fs::path program = folder_ / "colmap";
    std::ofstream(program)
        << "#!/bin/sh\n"
           "if [ \"$2\" = -h ]; then cat <<END\n"
           "  --SiftExtraction.use_gpu\n  --SiftExtraction.num_threads\n"
           "  --SiftExtraction.max_image_size\n  --SiftExtraction.max_num_features\n"
           "  --SiftMatching.use_gpu\n  --SiftMatching.num_threads\n  --Mapper.num_threads\n"
           "END\nexit 0\nfi\n"
        << body << "\n";
    fs::permissions(program, fs::perms::owner_all);
  }

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

  fs::path folder_;
  std::string old_path_;
};

TEST_F(StandInColmap, MissingProgramNamesTheRemedy) {
  setenv("PATH", folder_.c_str(), 1);
  EXPECT_NE(ErrorOf([&] { Make(); }, io::ExitCode::kMissingTool).find("apt-get install colmap"),
            std::string::npos);
}

TEST_F(StandInColmap, ACrashIsReportedWithTheLastLines) {
  Install("echo the last words; kill -SEGV $$");
  sfm::Colmap colmap = Make();
  const std::string message = ErrorOf([&] { colmap.Map("", 5); }, io::ExitCode::kMissingTool);
  EXPECT_NE(message.find("mapper crashed with signal 11"), std::string::npos) << message;
  EXPECT_NE(message.find("the last words"), std::string::npos) << message;
}

TEST_F(StandInColmap, LackOfMemoryIsNoFaultOfTheProgram) {
  Install("echo \"terminate called after throwing an instance of 'std::bad_alloc'\"; kill -ABRT $$");
  sfm::Colmap colmap = Make();
  EXPECT_NE(ErrorOf([&] { colmap.Map("", 5); }, io::ExitCode::kNoResources).find("memory"),
            std::string::npos);
}

TEST_F(StandInColmap, NoModelIsAnAnswer) {
  Install("echo failed to create sparse model; exit 1");
  sfm::Colmap colmap = Make();
  EXPECT_TRUE(colmap.Map("", 5).empty());
}

TEST_F(StandInColmap, ModelsThatCannotBeMergedAreNoFailure) {
  for (const char* body : {"exit 1", "exit 0"}) {
    Install(body);
    sfm::Colmap colmap = Make();
    EXPECT_FALSE(colmap.Merge(folder_ / "0", folder_ / "1")) << body;
  }
}

TEST_F(StandInColmap, ExtractionWithoutADatabaseIsNotBelieved) {
  Install("exit 0");
  sfm::Colmap colmap = Make();
  ErrorOf([&] { Extract(&colmap); }, io::ExitCode::kBadState);
}

TEST_F(StandInColmap, VerificationWithoutADatabaseIsNotBelieved) {
  Install("exit 0");
  sfm::Colmap colmap = Make();
  sfm::CapturedViews views{.names = {"a.png", "b.png"}, .features = std::vector<sfm::Features>(2)};
  views.groups = {{.names = views.names, .width = 640, .height = 480}};
  ErrorOf([&] { colmap.VerifyMatches(views, {{.a = 0, .b = 1}}); }, io::ExitCode::kBadState);
}

TEST_F(StandInColmap, ExtractionThatSkipsPicturesIsNotBelieved) {
  fs::create_directories(folder_ / "images");
  std::ofstream(folder_ / "images" / "a.png") << "not a picture";
  setenv("PATH", old_path_.c_str(), 1);
  if (std::system("command -v colmap >/dev/null") != 0) GTEST_SKIP() << "colmap is not installed";
  sfm::Colmap colmap = Make();
  const std::string message = ErrorOf([&] { Extract(&colmap); }, io::ExitCode::kMissingTool);
  EXPECT_NE(message.find("skipped a.png"), std::string::npos) << message;
}

TEST_F(StandInColmap, ArgumentsAreThoseOfTheInstalledVersion) {
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
