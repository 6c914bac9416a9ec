// The report: figures, commands and masks as they are, escaped names, and faults named by file.
#include "pipeline/report/report.h"
#include "io/base/json.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/image/mask.h"
#include "io/scene/transforms.h"
#include "pipeline/stages/trained_scene.h"
#include "tests/support/files/sphere_run.h"

namespace {

namespace fs = std::filesystem;
using io::Json;
using tests::RunReport;
using tests::SphereRun;

TEST(Report, ShowsFiguresReasonsAndCommands) {
  const SphereRun run;
  ASSERT_EQ(RunReport(run.path()), 0);
  const std::string html = io::ReadFile(run.path() / "report.html");
  for (const char* text : {"24 of 25",
                           "25 kept, 1 dropped",
                           "few matches",
                           "blurred: 0.21",
                           "16 bits became 8",
                           "hash table 2^17",
                           "capture",
                           "pipeline train --out=&#39;sphere run&#39; --time=3m",
                           "pipeline run &#39;/home/someone/sphere photos/&#39; --time=3m",
                           "pipeline render --threads=2",
                           "2.10 million parameters"}) {
    EXPECT_NE(html.find(text), std::string::npos) << text;
  }
  EXPECT_EQ(html.find("<img src=x"), std::string::npos) << "a file name became an element";
  EXPECT_EQ(html.find("http://"), std::string::npos);
  EXPECT_EQ(html.find("https://"), std::string::npos);
}

TEST(Report, SaysHowMuchTheMasksLeave) {
  const SphereRun run;
  ASSERT_EQ(RunReport(run.path()), 0);
  EXPECT_EQ(io::ReadFile(run.path() / "report.html").find("Masks"), std::string::npos);
  Json scene = io::ParseJson(io::ReadFile(run.path() / "scene/scene.json"));
  scene.update({{"masks", 17}, {"used_share", 0.4249}});
  run.Write("scene/scene.json", scene);
  ASSERT_EQ(RunReport(run.path()), 0);
  const std::string html = io::ReadFile(run.path() / "report.html");
  const std::size_t sentence = html.find("Masks");
  ASSERT_NE(sentence, std::string::npos);
  const std::string text = html.substr(sentence, html.find('<', sentence) - sentence);
  EXPECT_NE(text.find("17 "), std::string::npos) << text;
  EXPECT_NE(text.find("42 %"), std::string::npos) << text;
}

TEST(Report, ShowsWhatTrainingLeftOut) {
  const SphereRun run;
  ASSERT_EQ(RunReport(run.path()), 0);
  EXPECT_EQ(io::ReadFile(run.path() / "report.html").find("Left out"), std::string::npos);
  const io::Scene train = io::ReadTransforms(run.path() / "scene/transforms_train.json").scene;
  io::Mask mask{.width = train.cameras[0].width, .height = train.cameras[0].height, .used = {}};
  mask.used.assign(static_cast<std::size_t>(mask.width * mask.height), 255);
  std::fill_n(mask.used.begin(), 3 * mask.width, 0);
  fs::create_directories(run.path() / "train/masks");
  io::WriteMask(pipeline::TrainingMaskPath(run.path() / "train", train.frames[1]), mask);
  ASSERT_EQ(RunReport(run.path()), 0);
  const std::string html = io::ReadFile(run.path() / "report.html");
  EXPECT_NE(html.find("Left out"), std::string::npos);
  EXPECT_NE(html.find("alt=\"" + train.frames[1].image_path.filename().string()), std::string::npos);
}

TEST(Report, IsWrittenAgainOnlyWhenSomethingChanged) {
  const SphereRun run;
  ASSERT_EQ(RunReport(run.path()), 0);
  const auto first = fs::last_write_time(run.path() / "report.html");
  ASSERT_EQ(RunReport(run.path()), 0);
  EXPECT_EQ(fs::last_write_time(run.path() / "report.html"), first);
  io::WriteFileAtomically(run.path() / "report.html", "damaged");
  ASSERT_EQ(RunReport(run.path()), 0);
  EXPECT_GT(io::ReadFile(run.path() / "report.html").size(), 10000u);
  fs::remove(run.path() / "train/curve.csv");
  ASSERT_EQ(RunReport(run.path()), 0);
  EXPECT_NE(io::ReadFile(run.path() / "report.html").find("No training curve"), std::string::npos);
}

TEST(Report, DamagedFilesAreRefusedByName) {
  for (const char* file : {"ingest/frames.json", "evaluate/metrics.json", "scene/scene.json"}) {
    const SphereRun run;
    Json json = io::ParseJson(io::ReadFile(run.path() / file));
    for (const char* key : {"kept", "psnr", "protocol"}) json[key] = Json::array({1});
    run.Write(file, json);
    testing::internal::CaptureStderr();
    EXPECT_EQ(RunReport(run.path()), 3) << file;
    EXPECT_NE(testing::internal::GetCapturedStderr().find(file), std::string::npos);
    EXPECT_FALSE(fs::exists(run.path() / "report.html"));
  }
}

TEST(Report, FolderWithoutARunIsRefused) {
  const fs::path folder = fs::temp_directory_path() / ("report empty " + std::to_string(getpid()));
  EXPECT_EQ(RunReport(folder), 3);
  EXPECT_FALSE(fs::exists(folder / "report.html"));
  fs::remove_all(folder);
}

}  // namespace
