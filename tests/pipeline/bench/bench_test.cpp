// pipeline/bench*.h: options, tables, true poses and plots of the benchmarks.
#include "pipeline/bench/bench.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "io/base/error.h"
#include "io/image/image.h"
#include "io/process/process.h"
#include "pipeline/bench/bench.h"
#include "pipeline/bench/bench_table.h"
#include "pipeline/bench/true_poses.h"
#include "pipeline/report/bar_plot.h"
#include "pipeline/report/plot_svg.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/require_program.h"

namespace {

using io::ExitCode;

// Exit code and stderr of `pipeline bench ARGUMENTS`.
std::pair<int, std::string> Bench(std::vector<std::string> arguments) {
  std::vector<const char*> argv = {"bench"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  const int code = pipeline::RunBench(static_cast<int>(argv.size()), argv.data());
  testing::internal::GetCapturedStdout();
  return {code, testing::internal::GetCapturedStderr()};
}

void ExpectUsageError(const std::vector<std::string>& arguments, const std::string& part) {
  const auto [code, message] = Bench(arguments);
  EXPECT_EQ(code, static_cast<int>(ExitCode::kUsage)) << message;
  EXPECT_NE(message.find(part), std::string::npos) << message;
}

int CountLines(const std::string& text) {
  return static_cast<int>(std::count(text.begin(), text.end(), '\n'));
}

TEST(Bench, OptionsAreChecked) {
  const TempDir dir;
  const std::string out = (dir / "out").string();
  EXPECT_EQ(Bench({}).first, static_cast<int>(ExitCode::kUsage));
  EXPECT_EQ(Bench({"--help"}).first, 0);
  EXPECT_EQ(Bench({"sfm", "--help"}).first, 0);
  ExpectUsageError({"smf"}, "Did you mean sfm?");
  ExpectUsageError({"sfm", "--matrix"}, "--out DIR is missing");
  ExpectUsageError({"sfm", "--out", out}, "nothing to measure");
  ExpectUsageError({"sfm", "--out", out, "--matrix", "--seeds", "0"}, "--seeds: 0");
  ExpectUsageError({"sfm", "--out", out, "--matrix", "--cases", "S01,S99"}, "--cases: 'S99' is unknown");
  ExpectUsageError({"sfm", "--out", out, "--images", out, "--features", "1024,x"}, "--features: 'x'");
  ExpectUsageError({"sfm", "--out", out, "--images", out, "--sizes=-1"}, "--sizes: '-1'");
  EXPECT_EQ(Bench({"sfm", "--out", out, "--images", out}).first, static_cast<int>(ExitCode::kBadInput));
}

std::string Encoded(const char* extension) {
  const std::vector<std::uint8_t> bytes = io::EncodeImage(io::MakeImage(32, 24, 3), extension);
  return {bytes.begin(), bytes.end()};
}

// `jpeg` with an EXIF orientation of 6.
std::string OnItsSide(std::string jpeg) {
  using namespace std::string_literals;
  return jpeg.insert(2,
                     "\xff\xe1\0\x22"
                     "Exif\0\0"
                     "II*\0\x08\0\0\0"
                     "\x01\0"
                     "\x12\x01\x03\0\x01\0\0\0\x06\0\0\0"
                     "\0\0\0\0"s);
}

TEST(Bench, PicturesOnTheirSideAreRefusedByName) {
  const TempDir dir;
  WriteText(dir / "in/a.jpg", OnItsSide(Encoded(".jpg")));
  const auto [code, message] =
      Bench({"sfm", "--out", (dir / "out").string(), "--images", (dir / "in").string()});
  EXPECT_EQ(code, static_cast<int>(ExitCode::kBadInput)) << message;
  EXPECT_NE(message.find("a.jpg: lies on its side"), std::string::npos) << message;
}

TEST(Bench, AWrongValueEndsTheSweep) {
  const TempDir dir;
  for (const char* name : {"in/a.png", "in/b.png", "in/c.png"}) WriteText(dir / name, Encoded(".png"));
  ExpectUsageError(
      {"sfm", "--out", (dir / "out").string(), "--images", (dir / "in").string(), "--features=50"},
      "--features: 50 is not in");
}

TEST(Bench, KernelsAreTimedBesideThePeak) {
  const TempDir dir;
  ASSERT_EQ(Bench({"sfm", "--out", dir.path().string(), "--kernels"}).first, 0);
  const std::string csv = ReadText(dir / "kernels.csv");
  EXPECT_EQ(csv.rfind("build,features,ms,gmac_per_s,peak_gmac_per_s,share_of_peak\n", 0), 0u) << csv;
  EXPECT_NE(csv.find("\nportable,4096,"), std::string::npos) << csv;
}

// The value of column `i` of a line of CSV without quoted fields behind it, counted from the end.
double FromEnd(const std::string& line, int i) {
  std::size_t at = line.size();
  for (int k = 0; k <= i; ++k) at = line.rfind(',', at - 1);
  return std::strtod(line.c_str() + at + 1, nullptr);
}

TEST(Bench, FieldKernelsAreTimedBesideTheirLimits) {
  const TempDir dir;
  const auto [code, message] =
      Bench({"kernels", "--out", dir.path().string(), "--builds", "portable", "--rounds", "1"});
  ASSERT_EQ(code, 0) << message;
  std::istringstream csv(ReadText(dir / "kernels.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line, pipeline::kBenchTableHeader);
  int times = 0, shares = 0;
  while (std::getline(csv, line)) {
    EXPECT_GT(FromEnd(line, 0), 0) << line;
    EXPECT_TRUE(std::isfinite(FromEnd(line, 0))) << line;
    times += line.find(",time,ns/") != std::string::npos;
    shares += line.find(",share of limit,%,") != std::string::npos;
  }
  // 2 formats of 6 x (encode, position_gradient, scatter), 5 x (matmul, matmul_gradient), head,
  // head_gradient, 4 x optimiser; 3 functions and march. One kind of arithmetic, 6 x 3 kinds of access, 3
  // streams. SSIM.
  EXPECT_EQ(shares, 2 * (18 + 10 + 2 + 4) + 3 + 1);
  EXPECT_EQ(times, shares + 1 + 18 + 3 + 1);
  const std::string svg = ReadText(dir / "kernels.svg");
  EXPECT_NE(svg.find(">matmul_gradient 64x64 bf16</text>"), std::string::npos);
  // Neither benchmark replaces the other's table.
  ExpectUsageError({"sfm", "--out", dir.path().string(), "--kernels"}, "was written by another benchmark");
  WriteText(dir / "kernels.csv", "build,features\n");
  ExpectUsageError({"kernels", "--out", dir.path().string()}, "was written by another benchmark");
}

TEST(Bench, FieldKernelOptionsAreChecked) {
  const TempDir dir;
  const std::string out = (dir / "out").string();
  EXPECT_EQ(Bench({"kernels", "--help"}).first, 0);
  ExpectUsageError({"kernels"}, "--out DIR is missing");
  ExpectUsageError({"kernels", "--out", out, "--builds", "avx3"}, "--builds: 'avx3' is unknown");
  ExpectUsageError({"kernels", "--out", out, "--builds", ","}, "names no build");
  ExpectUsageError({"kernels", "--out", out, "--rounds", "0"}, "--rounds: 0");
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(Bench, BarsAreAsLongAsTheirValues) {
  const std::string svg = pipeline::BarPlotSvg(
      {.title = "<t>", .series = {"a", "b"}, .groups = {{"p", {50, std::nan("")}}, {"q", {0, 100}}}});
  EXPECT_NE(svg.find("&lt;t&gt;"), std::string::npos);
  EXPECT_NE(svg.find("width=\"250.0\""), std::string::npos) << svg;
  EXPECT_NE(svg.find("width=\"500.0\""), std::string::npos);
  int bars = 0;
  for (std::size_t at = svg.find("<rect x"); at != std::string::npos; at = svg.find("<rect x", at + 1))
    ++bars;
  EXPECT_EQ(bars, 3);  // none for NaN
  EXPECT_EQ(pipeline::BarPlotSvg({.groups = {{"p", {0}}}}), "");
}

// S14 has two pictures and is refused without starting COLMAP.
TEST(Bench, TheMatrixWritesOneLinePerRun) {
  REQUIRE_PROGRAM("colmap");
  const TempDir dir;
  const auto [code, message] =
      Bench({"sfm", "--out", (dir / "out").string(), "--matrix", "--cases", "S14", "--seeds", "3"});
  EXPECT_EQ(code, 0) << message;
  const std::string csv = ReadText(dir / "out" / "matrix.csv");
  EXPECT_EQ(CountLines(csv), 1 + 3);
  EXPECT_TRUE(csv.starts_with("machine,commit,case,title,seed,passed,folded,pictures,registered,"));
  EXPECT_NE(csv.find(",S14,2 pictures,3,1,0,2,0,nan,nan,nan,nan,0,0,0,0,"), std::string::npos) << csv;
  EXPECT_NE(csv.find("too few pictures"), std::string::npos);
  EXPECT_EQ(CountEntries(dir / "out"), 2);  // the marker and the table: the work folder is gone
}

// COLMAP, which works elsewhere, gets to see the folder as well.
TEST(Bench, AFolderMayBeGivenRelativeToTheCurrentOne) {
  REQUIRE_PROGRAM("colmap");
  const TempDir dir;
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(dir.path());
  const auto [code, message] = Bench({"sfm", "--out", "out", "--matrix", "--cases", "S17.1"});
  std::filesystem::current_path(before);
  EXPECT_EQ(code, 0) << message;
  const std::string csv = ReadText(dir / "out" / "matrix.csv");
  EXPECT_NE(csv.find(",S17.1,20 features per picture,1,1,0,14,"), std::string::npos) << csv;
}

TEST(Bench, CsvFieldsAreQuotedWhereNeeded) {
  EXPECT_EQ(pipeline::CsvLine({"a", "", "b c"}), "a,,b c\n");
  EXPECT_EQ(pipeline::CsvLine({"", "x"}), ",x\n");
  EXPECT_EQ(pipeline::CsvLine({"1,5", "say \"so\"", "two\nlines"}),
            "\"1,5\",\"say \"\"so\"\"\",\"two\nlines\"\n");
}

TEST(Bench, CsvNumbersReadBackAsTheSameValue) {
  int cases = 0;
  for (const double value : {0.0, -1.5, 0.1, 1.0 / 3, 6.02e23, 5e-324, std::numeric_limits<double>::max()}) {
    EXPECT_EQ(std::strtod(pipeline::CsvNumber(value).c_str(), nullptr), value);
    ++cases;
  }
  EXPECT_EQ(cases, 7);
  EXPECT_EQ(pipeline::CsvNumber(0.1), "0.1");
  EXPECT_EQ(pipeline::CsvNumber(-std::nan("")), "nan");
  EXPECT_EQ(pipeline::CsvNumber(std::numeric_limits<double>::infinity()), "inf");
}

TEST(Bench, TheLongTableNamesMachineAndCommitOnEveryLine) {
  const TempDir dir;
  const double inf = std::numeric_limits<double>::infinity();
  pipeline::WriteBenchTable(
      dir / "t.csv",
      {{"ours, on x", "features=5", "wall", "s", 1.25}, {"COLMAP", "", "centre_rmse", "extent", inf}});
  const std::string text = ReadText(dir / "t.csv");
  EXPECT_EQ(CountLines(text), 3);
  EXPECT_TRUE(text.starts_with("machine,commit,what,parameters,metric,unit,value\n"));
  const std::string both = pipeline::CsvLine({pipeline::BenchMachine(), pipeline::BenchCommit()});
  const std::string prefix = "\n" + both.substr(0, both.size() - 1);
  EXPECT_NE(text.find(prefix + ",\"ours, on x\",features=5,wall,s,1.25\n"), std::string::npos) << text;
  EXPECT_NE(text.find(prefix + ",COLMAP,,centre_rmse,extent,inf\n"), std::string::npos) << text;
  EXPECT_NE(pipeline::BenchMachine().find(" cores"), std::string::npos);
}

TEST(Bench, ListsAreSplitStrictly) {
  EXPECT_EQ(pipeline::SplitList(" a, b c ,,d"), (std::vector<std::string>{"a", "b c", "d"}));
  EXPECT_TRUE(pipeline::SplitList("").empty());
  EXPECT_EQ(pipeline::SplitIntegers("sizes", "800, 1600,0", 0), (std::vector<int>{800, 1600, 0}));
  for (const char* text : {"8x", "1.5", "-1", "99999999999"})
    EXPECT_ERROR(pipeline::SplitIntegers("sizes", text, 0), ExitCode::kUsage, "--sizes: '");
  EXPECT_ERROR(pipeline::SplitIntegers("features", "0", 1), ExitCode::kUsage, "not a number >= 1");
}

// The camera stands at (1, 2, 3) and looks along the world's +y with its right side towards +x: its axes x
// right, y down, z forward are the columns (1,0,0), (0,0,-1), (0,1,0).
constexpr const char* kCamera =
    "2759.48 0 1520.69 \n0 2764.16 1006.81 \n0 0 1 \n0 0 0\n1 0 0\n0 0 1\n0 -1 0\n1 2 3\n3072 2048\n";

TEST(Bench, StrechaCamerasAreReadWithTheirAxes) {
  const TempDir dir;
  WriteText(dir / "0010.jpg.camera", kCamera);
  WriteText(dir / "0002.jpg.camera", kCamera);
  WriteText(dir / "notes.txt", "no camera");
  const io::Scene scene = pipeline::ReadTruePoses(dir.path());
  ASSERT_EQ(scene.frames.size(), 2u);
  EXPECT_EQ(scene.frames[0].image_path, "0002.jpg");
  EXPECT_EQ(scene.frames[1].camera_index, 1);
  EXPECT_EQ(
      scene.cameras[0],
      (io::Camera{
          .width = 3072, .height = 2048, .fl_x = 2759.48, .fl_y = 2764.16, .cx = 1520.69, .cy = 1006.81}));
  const io::Rigid3d& pose = scene.frames[0].world_from_cam;
  // A point 5 in front, 1 to the right and 2 above, in OpenGL axes.
  EXPECT_LT((pose * Eigen::Vector3d(1, 2, -5) - Eigen::Vector3d(2, 7, 5)).norm(), 1e-12);
}

TEST(Bench, DamagedTruthIsNamed) {
  const TempDir dir;
  EXPECT_ERROR(pipeline::ReadTruePoses(dir.path()), ExitCode::kBadInput, "holds no *.camera files");
  std::string text = kCamera;
  WriteText(dir / "a.camera", text.substr(0, text.size() - 10));
  EXPECT_ERROR(pipeline::ReadTruePoses(dir.path()), ExitCode::kBadInput, "a.camera: does not begin with");
  text.replace(text.find("0 -1 0"), 6, "0 1 0");
  WriteText(dir / "a.camera", text);
  EXPECT_ERROR(pipeline::ReadTruePoses(dir.path()), ExitCode::kBadInput, "no rotation");
  EXPECT_ERROR(pipeline::ReadTruePoses(dir / "none.json"), ExitCode::kBadInput, "none.json");
}

TEST(Bench, ScatterPlotsHaveDotsAndLabels) {
  const std::string svg =
      pipeline::PlotSvg({{.label = "a",
                          .x = {1, 10, 0, 1000},
                          .y = {1, 2, 3, std::nan("")},
                          .point_labels = {"<p>", "q", "r", "s"}}},
                        {.x_label = "x", .y_label = "y", .log_y = true, .log_x = true, .scatter = true});
  const auto count = [&](const std::string& part) {
    int n = 0;
    for (std::size_t at = svg.find(part); at != std::string::npos; at = svg.find(part, at + 1)) ++n;
    return n;
  };
  EXPECT_EQ(count("<circle"), 2);  // neither 0 nor NaN has a logarithm
  EXPECT_EQ(count("&lt;p&gt;"), 1);
  EXPECT_EQ(count(">q<"), 1);
  EXPECT_EQ(count(">r<"), 0);
  EXPECT_EQ(count("<polyline"), 0);
  // On a logarithmic axis from 1 to 10, widened by 0.05 at both ends, the dots lie at 1/22 and 21/22 of the
  // 492 units right of 56.
  EXPECT_EQ(count("cx=\"78.4\""), 1);
  EXPECT_EQ(count("cx=\"525.6\""), 1);

  const std::string one = pipeline::PlotSvg({{.label = "a", .x = {3}, .y = {3}}}, {.scatter = true});
  EXPECT_NE(one.find("<circle"), std::string::npos);
  const std::string file = pipeline::StandaloneSvg({one, svg});
  EXPECT_TRUE(file.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 560 600\""));
  EXPECT_NE(file.find("<g transform=\"translate(0,300)\">"), std::string::npos);
  EXPECT_EQ(file.find("<svg", 1), std::string::npos);
  EXPECT_EQ(file.find("</svg>"), file.size() - 7);
  // Within one decade the ticks are those of a linear axis: 6 and 7 appear, which are no 1, 2 or 5.
  const std::string narrow =
      pipeline::PlotSvg({{.label = "a", .x = {5.5, 8.2}, .y = {1, 2}}}, {.log_x = true});
  EXPECT_NE(narrow.find(">6<"), std::string::npos);
  EXPECT_NE(narrow.find(">7<"), std::string::npos);
}

}  // namespace
