// The report in headless Chromium, as wide as a phone: no errors, the film decodes, every picture shows; and
// a run that is incomplete still gives a whole page.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"
#include "tests/support/files/sphere_run.h"
#include "tests/support/programs/browser.h"
#include "tests/support/programs/require_program.h"

namespace {

namespace fs = std::filesystem;
using io::Json;
using tests::RunReport;
using tests::SphereRun;

std::string Replaced(std::string text, const std::string& old, const std::string& with) {
  const std::size_t at = text.find(old);
  EXPECT_NE(at, std::string::npos) << old;
  return at == std::string::npos ? text : text.replace(at, old.size(), with);
}

// What a script inside the page sees once film and pictures have loaded.
Json Open(const fs::path& page) {
  const TempDir folder;
  io::WriteFileAtomically(
      folder.path() / "probe.html",
      Replaced(io::ReadFile(page),
               "<meta charset=\"utf-8\">",
               "<meta charset=\"utf-8\"><script>window.faults = [];"
               "addEventListener('error', e => faults.push(String(e.message || e.target.outerHTML)), true);"
               "addEventListener('securitypolicyviolation', e => faults.push(e.blockedURI));"
               "console.error = (...all) => faults.push(all.join(' '));</script>"));
  Browser browser("file://" + (folder.path() / "probe.html").string(), 390, 844);
  EXPECT_TRUE(
      browser.Becomes("!document.querySelector('video') || document.querySelector('video').readyState >= 2"));
  return browser.Evaluate(R"((() => {
    const video = document.querySelector('video'), canvas = document.getElementById('scene');
    const painted = canvas && canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    return {
      faults, images: [...document.images].map(i => i.naturalWidth), title: document.title,
      video: video ? [video.readyState, video.videoWidth, video.videoHeight, video.duration] : [],
      painted: painted ? painted.filter((v, i) => i % 4 == 3 && v > 0).length : 0,
      plots: document.querySelectorAll('svg.plot polyline').length,
      overflow: document.documentElement.scrollWidth - innerWidth};
  })())");
}

TEST(ReportInBrowser, WholeRunShowsEverythingWithoutAFault) {
  REQUIRE_PROGRAM("chromium");
  const SphereRun run;
  ASSERT_EQ(RunReport(run.path()), 0);
  const Json seen = Open(run.path() / "report.html");
  EXPECT_EQ(seen["faults"], Json::array()) << seen["faults"];
  EXPECT_EQ(seen["title"], "sphere photos");
  // Truth, render, error; three frames of the film with their support, and its two scales.
  ASSERT_EQ(seen["images"].size(), static_cast<std::size_t>(3 * SphereRun::kViews + 3 * 3 + 2));
  for (const Json& width : seen["images"]) EXPECT_GT(width, 0);
  EXPECT_GE(seen["video"][0].get<double>(), 2);  // HAVE_CURRENT_DATA
  EXPECT_EQ(seen["video"][1], 120);
  EXPECT_EQ(seen["video"][2], 90);
  EXPECT_NEAR(seen["video"][3].get<double>(), 12 / 30.0, 0.05);
  EXPECT_GT(seen["painted"].get<double>(), 3000);
  EXPECT_EQ(seen["plots"], 3);  // training PSNR, held-out PSNR, loss
  EXPECT_LE(seen["overflow"].get<double>(), 0) << "wider than a phone";
}

TEST(ReportInBrowser, RunWithoutFilmScoresAndPicturesIsStillAPage) {
  REQUIRE_PROGRAM("chromium");
  const SphereRun run;
  for (const char* part : {"ingest", "sfm", "evaluate", "render"}) fs::remove_all(run.path() / part);
  fs::remove(run.path() / "train/curve.csv");
  ASSERT_EQ(RunReport(run.path()), 0);
  const std::string html = io::ReadFile(run.path() / "report.html");
  for (const char* text : {"No film", "No scores", "No training curve", "input came with poses", "not run"}) {
    EXPECT_NE(html.find(text), std::string::npos) << text;
  }
  const Json seen = Open(run.path() / "report.html");
  EXPECT_EQ(seen["faults"], Json::array()) << seen["faults"];
  EXPECT_EQ(seen["images"], Json::array());
  EXPECT_GT(seen["painted"].get<double>(), 3000);
}

}  // namespace
