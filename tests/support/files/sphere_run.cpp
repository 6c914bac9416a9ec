#include "tests/support/files/sphere_run.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/json.h"
#include "io/base/owned_folder.h"
#include "io/image/image.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/film/film.h"
#include "pipeline/report/report.h"
#include "pipeline/stage/frames.h"
#include "tests/support/scenes/sphere_field.h"

namespace tests {
namespace {

namespace fs = std::filesystem;
using io::Json;

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

}  // namespace

SphereRun::SphereRun() : path_(fs::temp_directory_path() / ("sphere run " + std::to_string(getpid()))) {
  fs::remove_all(path_);
  io::ClaimFolder(path_);
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

SphereRun::~SphereRun() { fs::remove_all(path_); }

void SphereRun::Write(const fs::path& file, const Json& json) const {
  io::WriteFileAtomically(path_ / file, io::DumpJson(json, 1));
}

io::Scene SphereRun::Split(const std::string& name, int n) const {
  io::Scene scene = RingScene(
      n, 120, 90, [&](int i) { return path_ / "scene/images" / (name + "_" + std::to_string(i) + ".png"); });
  for (const io::Frame& frame : scene.frames) {
    io::WriteImage(frame.image_path,
                   pipeline::QuantizeView(SphereField().Render(scene.cameras[0], frame.world_from_cam, {})));
  }
  return scene;
}

void SphereRun::WriteScene() {
  train_ = Split("train", 18);
  test_ = Split("test", kViews);
  std::vector<io::Point3D> points(3000);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double z = 2.0 * static_cast<double>(i) / static_cast<double>(points.size()) - 1,
                 a = 2.4 * static_cast<double>(i);
    points[i].xyz = {std::sqrt(1 - z * z) * std::cos(a), std::sqrt(1 - z * z) * std::sin(a), z};
    points[i].rgb = {static_cast<std::uint8_t>(128 + 100 * z), 120, 90};
  }
  io::WritePly(path_ / "scene/points.ply", points);
  io::WriteTransforms(path_ / "scene/transforms_train.json", train_, "points.ply");
  io::WriteTransforms(path_ / "scene/transforms_test.json", test_, "points.ply");
  Write("scene/scene.json", Record("normalize", 1.2, {"near 2, far 6: f/n is 2.4"}));
}

void SphereRun::WriteTraining() const {
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
  io::WriteFileAtomically(path_ / "train/curve.csv", csv);
  Json record =
      Record("train", 182, {"hash table 2^17: the finest level matches the median pixel footprint"});
  record["field"] = "hash";
  record["parameters"] = 2.1e6;
  record["steps"] = 2000;
  record["train_s"] = 180;
  Write("train/train.json", record);
}

void SphereRun::WriteScores() const {
  const fs::path folder = path_ / "evaluate";
  pipeline::RenderViews(SphereField(0.04f), test_, folder, 2);
  pipeline::Scores scores = pipeline::ScoreViews(test_, folder, {});
  scores.protocol = "capture";
  pipeline::WriteScores(scores, folder);
  Write("evaluate/evaluate.json", Record("evaluate", 3.4, {}));
}

void SphereRun::WriteFilm() const {
  pipeline::FilmOptions options;
  options.frames = 12;
  pipeline::RenderFilm(SphereField(0.04f), train_, options, path_ / "render");
  Json record = Record("render", 9, {"film codec libx264: a two-frame clip decodes again"});
  record["frames"] = 12;
  record["ms_per_frame"] = 81;
  Write("render/render.json", record);
}

void SphereRun::WritePictures() const {
  pipeline::Frames frames;
  for (int i = 0; i < 25; ++i) {
    frames.kept.push_back(
        {.name = "p" + std::to_string(i) + ".png", .source = "p.jpg", .width = 120, .height = 90});
  }
  frames.kept[3].notes = {"16 bits became 8"};
  frames.dropped = {{kNastyName, "blurred: 0.21 of its neighbours' sharpness"}};
  pipeline::WriteFrames(path_ / "ingest/frames.json", frames);
  Write("ingest/ingest.json", Record("ingest", 4, {"1 of 26 pictures dropped"}));
  Json sfm = Record("sfm", 61, {"exhaustive matching: 25 pictures are 300 pairs"});
  sfm.update({{"images", 25}, {"registered", 24}, {"points", 3000}, {"mean_reprojection_error_px", 0.61}});
  sfm["unregistered"] = {{{"name", "p7.png"}, {"cause", "few matches"}}};
  Write("sfm/sfm.json", sfm);
}

int RunReport(const fs::path& run_folder) {
  const std::string out = run_folder.string();
  const char* argv[] = {"pipeline-report", "--out", out.c_str()};
  return pipeline::RunReport(3, argv);
}

}  // namespace tests
