// The report, opened in headless Chromium: no errors, the film decodes, every picture shows; and runs that
// are incomplete or hold awkward names still give a whole page.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "io/base/process.h"
#include "io/image/image.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "pipeline/report/report_page.h"
#include "pipeline/stage/frames.h"
#include "pipeline/stages/evaluation.h"
#include "pipeline/stages/film.h"

#include "pipeline/report/report.h"
#include "tests/support/require_program.h"
#include "tests/support/sphere_field.h"

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using tests::SphereField;

constexpr int kViews = 6;
// Names like these reach the page from users' disks.
const std::string kNastyName = "</script><img src=x onerror=alert(1)> & \"quotes\" \xff.jpg";

Json Record(const std::string& stage, double wall_s, const std::vector<std::string>& decisions) {
  return {
      {"stage", stage},
      {"status", "done"},
      {"wall_s", wall_s},
      {"cpu_s", 1.7 * wall_s},
      {"peak_rss_bytes", 3e8},
      {"options",
       {{"threads", {{"value", 2}, {"origin", "flag"}}}, {"seed", {{"value", 1}, {"origin", "default"}}}}},
      {"decisions", decisions}};
}

// A finished run of the sphere, made without the stages.
class RunFolder {
 public:
  RunFolder() : path(fs::temp_directory_path() / ("report test " + std::to_string(getpid()))) {
    fs::remove_all(path);
    io::ClaimFolder(path);
    WriteScene();
    WriteTraining();
    WriteScores();
    WriteFilm();
    WritePictures();
    Write("run.json",
          {{"versions", {{"pipeline", "0.1.0"}, {"opencv", "4.6.0"}}},
           {"host", {{"name", "testbench"}, {"cores", 2}}},
           {"input", "/home/someone/sphere photos/"},
           {"options", {{"time", {{"value", "3m"}, {"origin", "flag"}}}}},
           {"commands", {{"train", "pipeline train --out='sphere run' --time=3m"}}}});
  }
  ~RunFolder() { fs::remove_all(path); }

  void Write(const fs::path& file, const Json& json) const {
    io::WriteFileAtomically(path / file, json.dump(1, ' ', false, Json::error_handler_t::replace));
  }

  const fs::path path;

 private:
  io::Scene Split(const std::string& name, int n) const {
    io::Scene scene = tests::RingScene(
        n, 120, 90, [&](int i) { return path / "scene/images" / (name + "_" + std::to_string(i) + ".png"); });
    for (const io::Frame& frame : scene.frames) {
      io::WriteImage(
          frame.image_path,
          pipeline::QuantizeView(SphereField().Render(scene.cameras[0], frame.world_from_cam, {})));
    }
    return scene;
  }

  void WriteScene() {
    train_ = Split("train", 18);
    test_ = Split("test", kViews);
    std::vector<io::Point3D> points(3000);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double z = 2.0 * static_cast<double>(i) / static_cast<double>(points.size()) - 1,
                   a = 2.4 * static_cast<double>(i);
      points[i].xyz = {std::sqrt(1 - z * z) * std::cos(a), std::sqrt(1 - z * z) * std::sin(a), z};
      points[i].rgb = {static_cast<std::uint8_t>(128 + 100 * z), 120, 90};
    }
    io::WritePly(path / "scene/points.ply", points);
    io::WriteTransforms(path / "scene/transforms_train.json", train_, "points.ply");
    io::WriteTransforms(path / "scene/transforms_test.json", test_, "points.ply");
    Write("scene/scene.json", Record("normalize", 1.2, {"near 2, far 6: f/n is 2.4"}));
  }

  void WriteTraining() const {
    std::string csv = "step,wall_s,cpu_s,loss,train_psnr,heldout_psnr\n";
    for (int step = 0; step <= 2000; step += 50) {
      const double psnr = 28 - 16 * std::exp(-step / 400.0);
      char line[128];
      std::snprintf(line,
                    sizeof line,
                    "%d,%.2f,%.2f,%.6f,%.3f,",
                    step,
                    0.09 * step,
                    0.18 * step,
                    std::pow(10, -psnr / 10),
                    psnr);
      csv += line;
      if (step % 400 == 0) csv += std::to_string(psnr - 1);
      csv += "\n";
    }
    io::WriteFileAtomically(path / "train/curve.csv", csv);
    Json record =
        Record("train", 182, {"hash table 2^17: the finest level matches the median pixel footprint"});
    record["field"] = "hash";
    record["parameters"] = 2.1e6;
    record["steps"] = 2000;
    record["train_s"] = 180;
    Write("train/train.json", record);
  }

  void WriteScores() const {
    const fs::path folder = path / "evaluate";
    pipeline::RenderViews(SphereField(0.04f), test_, folder, 2);
    pipeline::Scores scores = pipeline::ScoreViews(test_, folder, {});
    scores.protocol = "capture";
    pipeline::WriteScores(scores, folder);
    Write("evaluate/evaluate.json", Record("evaluate", 3.4, {}));
  }

  void WriteFilm() const {
    pipeline::FilmOptions options;
    options.frames = 12;
    pipeline::RenderFilm(SphereField(0.04f), train_, options, path / "render");
    Json record = Record("render", 9, {"film codec libx264: a two-frame clip decodes again"});
    record["frames"] = 12;
    record["ms_per_frame"] = 81;
    Write("render/render.json", record);
  }

  void WritePictures() const {
    pipeline::Frames frames;
    for (int i = 0; i < 25; ++i) {
      frames.kept.push_back(
          {.name = "p" + std::to_string(i) + ".png", .source = "p.jpg", .width = 120, .height = 90});
    }
    frames.kept[3].notes = {"16 bits became 8"};
    frames.dropped = {{kNastyName, "blurred: 0.21 of its neighbours' sharpness"}};
    pipeline::WriteFrames(path / "ingest/frames.json", frames);
    Write("ingest/ingest.json", Record("ingest", 4, {"1 of 26 pictures dropped"}));
    Json sfm = Record("sfm", 61, {"exhaustive matching: 25 pictures are 300 pairs"});
    sfm.update({{"images", 25}, {"registered", 24}, {"points", 3000}, {"mean_reprojection_error_px", 0.61}});
    sfm["unregistered"] = {{{"name", "p7.png"}, {"cause", "few matches"}}};
    Write("sfm/sfm.json", sfm);
  }

  io::Scene train_, test_;
};

int RunReport(const fs::path& run_folder) {
  const std::string out = run_folder.string();
  const char* argv[] = {"pipeline-report", "--out", out.c_str()};
  return pipeline::RunReport(3, argv);
}

std::string Replaced(std::string text, const std::string& old, const std::string& with) {
  const std::size_t at = text.find(old);
  EXPECT_NE(at, std::string::npos) << old;
  return at == std::string::npos ? text : text.replace(at, old.size(), with);
}

class Browser : public testing::Test {
 protected:
  void SetUp() override {
    REQUIRE_PROGRAM("chromium");
    program_ = *io::FindProgram("chromium");
    folder_ = fs::temp_directory_path() / ("report browser " + std::to_string(getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // What a script inside the page sees once film and pictures have loaded.
  Json Open(const fs::path& page) {
    std::string html = io::ReadFile(page);
    html =
        Replaced(html,
                 "<meta charset=\"utf-8\">",
                 "<meta charset=\"utf-8\"><script>window.faults = [];"
                 "addEventListener('error', e => faults.push(String(e.message || e.target.outerHTML)), true);"
                 "addEventListener('securitypolicyviolation', e => faults.push(e.blockedURI));"
                 "console.error = (...all) => faults.push(all.join(' '));</script>");
    html = Replaced(html, "</body>", R"(<script>
      addEventListener('load', () => {
        const video = document.querySelector('video'), canvas = document.getElementById('scene');
        const look = () => {
          const painted = canvas && canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
          const answer = document.createElement('pre');
          answer.id = 'answer';
          answer.textContent = btoa(JSON.stringify({
            faults, images: [...document.images].map(i => i.naturalWidth), title: document.title,
            video: video ? [video.readyState, video.videoWidth, video.videoHeight, video.duration] : [],
            painted: painted ? painted.filter((v, i) => i % 4 == 3 && v > 0).length : 0,
            plots: document.querySelectorAll('svg.plot polyline').length,
            overflow: document.documentElement.scrollWidth - innerWidth}));
          document.body.append(answer);
        };
        if (!video || video.readyState >= 2) look(); else video.addEventListener('loadeddata', look);
      });</script></body>)");
    const fs::path probe = folder_ / "probe.html", log = folder_ / "dom.txt";
    io::WriteFileAtomically(probe, html);
    const std::string mark = "<pre id=\"answer\">";
    std::string dom;
    // On a busy machine the browser's own clock runs out before the film is decoded.
    for (const char* budget_ms : {"8000", "80000", "800000"}) {
      Dump(probe, log, budget_ms);
      dom = io::ReadFile(log);
      if (dom.find(mark) != std::string::npos) break;
    }
    const std::size_t at = dom.find(mark);
    if (at == std::string::npos) {
      ADD_FAILURE() << "the page gave no answer: " << dom.substr(0, 2000);
      return {};
    }
    const std::string base64 =
        dom.substr(at + mark.size(), dom.find('<', at + mark.size()) - at - mark.size());
    return Json::parse(Decode(base64));
  }

  // Writes the page as it is when the budget of the browser's clock is spent.
  void Dump(const fs::path& page, const fs::path& log, const std::string& budget_ms) const {
    fs::remove(log);
    io::ProcessOptions options;
    options.timeout_s = 60;
    options.log_path = log;
    io::RunProcess({program_.string(),
                    "--headless",
                    "--no-sandbox",
                    "--disable-gpu",
                    "--disable-quic",
                    "--no-first-run",
                    "--disable-background-networking",
                    "--disable-component-update",
                    "--disable-sync",
                    "--autoplay-policy=no-user-gesture-required",
                    "--user-data-dir=" + (folder_ / "profile").string(),
                    "--window-size=390,844",
                    "--virtual-time-budget=" + budget_ms,
                    "--dump-dom",
                    "file://" + page.string()},
                   options);
  }

  static std::string Decode(const std::string& base64) {
    static const std::string kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string bytes;
    unsigned bits = 0;
    int n = 0;
    for (const char c : base64) {
      if (c == '=') break;
      bits = bits << 6 | static_cast<unsigned>(kDigits.find(c));
      if ((n += 6) >= 8) bytes += static_cast<char>(bits >> (n -= 8) & 255);
    }
    return bytes;
  }

  fs::path program_, folder_;
};

TEST_F(Browser, WholeRunShowsEverythingWithoutAFault) {
  const RunFolder run;
  ASSERT_EQ(RunReport(run.path), 0);
  const Json seen = Open(run.path / "report.html");
  EXPECT_EQ(seen["faults"], Json::array()) << seen["faults"];
  EXPECT_EQ(seen["title"], "sphere photos");
  // Truth, render, error; three frames of the film with their support, and its two scales.
  ASSERT_EQ(seen["images"].size(), static_cast<std::size_t>(3 * kViews + 3 * 3 + 2));
  for (const Json& width : seen["images"]) EXPECT_GT(width, 0);
  EXPECT_GE(seen["video"][0], 2);  // HAVE_CURRENT_DATA
  EXPECT_EQ(seen["video"][1], 120);
  EXPECT_EQ(seen["video"][2], 90);
  EXPECT_NEAR(seen["video"][3].get<double>(), 12 / 30.0, 0.05);
  EXPECT_GT(seen["painted"], 3000);
  EXPECT_EQ(seen["plots"], 3);  // training PSNR, held-out PSNR, loss
  EXPECT_LE(seen["overflow"], 0) << "wider than a phone";
}

TEST_F(Browser, RunWithoutFilmScoresAndPicturesIsStillAPage) {
  const RunFolder run;
  for (const char* part : {"ingest", "sfm", "evaluate", "render"}) fs::remove_all(run.path / part);
  fs::remove(run.path / "train/curve.csv");
  ASSERT_EQ(RunReport(run.path), 0);
  const std::string html = io::ReadFile(run.path / "report.html");
  for (const char* text : {"No film", "No scores", "No training curve", "input came with poses", "not run"}) {
    EXPECT_NE(html.find(text), std::string::npos) << text;
  }
  const Json seen = Open(run.path / "report.html");
  EXPECT_EQ(seen["faults"], Json::array()) << seen["faults"];
  EXPECT_EQ(seen["images"], Json::array());
  EXPECT_GT(seen["painted"], 3000);
}

TEST(Report, ShowsFiguresReasonsAndCommands) {
  const RunFolder run;
  ASSERT_EQ(RunReport(run.path), 0);
  const std::string html = io::ReadFile(run.path / "report.html");
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
  const RunFolder run;
  ASSERT_EQ(RunReport(run.path), 0);
  EXPECT_EQ(io::ReadFile(run.path / "report.html").find("Masks"), std::string::npos);
  Json scene = Json::parse(io::ReadFile(run.path / "scene/scene.json"));
  scene.update({{"masks", 17}, {"used_share", 0.4249}});
  run.Write("scene/scene.json", scene);
  ASSERT_EQ(RunReport(run.path), 0);
  const std::string html = io::ReadFile(run.path / "report.html");
  const std::size_t sentence = html.find("Masks");
  ASSERT_NE(sentence, std::string::npos);
  const std::string text = html.substr(sentence, html.find('<', sentence) - sentence);
  EXPECT_NE(text.find("17 "), std::string::npos) << text;
  EXPECT_NE(text.find("42 %"), std::string::npos) << text;
}

TEST(Report, IsWrittenAgainOnlyWhenSomethingChanged) {
  const RunFolder run;
  ASSERT_EQ(RunReport(run.path), 0);
  const auto first = fs::last_write_time(run.path / "report.html");
  ASSERT_EQ(RunReport(run.path), 0);
  EXPECT_EQ(fs::last_write_time(run.path / "report.html"), first);
  io::WriteFileAtomically(run.path / "report.html", "damaged");
  ASSERT_EQ(RunReport(run.path), 0);
  EXPECT_GT(io::ReadFile(run.path / "report.html").size(), 10000u);
  fs::remove(run.path / "train/curve.csv");
  ASSERT_EQ(RunReport(run.path), 0);
  EXPECT_NE(io::ReadFile(run.path / "report.html").find("No training curve"), std::string::npos);
}

TEST(Report, DamagedFilesAreRefusedByName) {
  for (const char* file : {"ingest/frames.json", "evaluate/metrics.json", "scene/scene.json"}) {
    const RunFolder run;
    Json json = Json::parse(io::ReadFile(run.path / file));
    for (const char* key : {"kept", "psnr", "protocol"}) json[key] = Json::array({1});
    run.Write(file, json);
    testing::internal::CaptureStderr();
    EXPECT_EQ(RunReport(run.path), 3) << file;
    EXPECT_NE(testing::internal::GetCapturedStderr().find(file), std::string::npos);
    EXPECT_FALSE(fs::exists(run.path / "report.html"));
  }
}

TEST(Report, FolderWithoutARunIsRefused) {
  const fs::path folder = fs::temp_directory_path() / ("report empty " + std::to_string(getpid()));
  EXPECT_EQ(RunReport(folder), 3);
  EXPECT_FALSE(fs::exists(folder / "report.html"));
  fs::remove_all(folder);
}

}  // namespace
