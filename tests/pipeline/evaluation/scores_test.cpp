// metrics.json: what is written comes back, and damage is named by file and place.
#include "pipeline/evaluation/scores.h"
#include "io/base/json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace {

using io::Json;

pipeline::Scores TwoViews() {
  return {
      .protocol = "nerf-400-white",
      .width = 400,
      .height = 300,
      .white_background = true,
      .masked = true,
      .views = {{.name = "b \"1\".png",
                 .psnr_db = 120,
                 .ssim = 1,
                 .flip = 0,
                 .aligned_psnr_db = 120,
                 .identical = true},
                {.name = "a.png",
                 .psnr_db = 100.0 / 3,
                 .ssim = 0.97,
                 .flip = 0.04,
                 .aligned_psnr_db = 35,
                 .budget = {{.fitted_psnr_db = 34, .unseen_error = 0.25}}}},
      .psnr_db = 230.0 / 3,
      .ssim = 0.985,
      .flip = 0.02,
      .psnr_of_mean_mse_db = 36.3,
      .aligned_psnr_db = 77.5,
      .training_psnr_db = 78.5,
      .plain_psnr_db = 9.25,
      .hidden_points = 0.125,
      .budget = {{.fitted_psnr_db = 77, .fitted_aligned_psnr_db = 78, .moved_px = 0.5, .sharpness = 0.75}}};
}

TEST(Scores, WrittenOnesComeBack) {
  const TempDir dir;
  const pipeline::Scores written = TwoViews();
  pipeline::WriteScores(written, dir.path());
  const pipeline::Scores read = pipeline::ReadScores(dir.path());
  EXPECT_EQ(read.protocol, written.protocol);
  EXPECT_EQ(read.width, written.width);
  EXPECT_EQ(read.height, written.height);
  EXPECT_EQ(read.white_background, written.white_background);
  EXPECT_EQ(read.masked, written.masked);
  EXPECT_EQ(read.psnr_db, written.psnr_db);
  EXPECT_EQ(read.ssim, written.ssim);
  EXPECT_EQ(read.flip, written.flip);
  EXPECT_EQ(read.psnr_of_mean_mse_db, written.psnr_of_mean_mse_db);
  EXPECT_EQ(read.aligned_psnr_db, written.aligned_psnr_db);
  EXPECT_EQ(read.training_psnr_db, written.training_psnr_db);
  EXPECT_EQ(read.plain_psnr_db, written.plain_psnr_db);
  EXPECT_EQ(read.hidden_points, written.hidden_points);
  EXPECT_EQ(read.budget, written.budget);
  ASSERT_EQ(read.views.size(), written.views.size());
  for (std::size_t i = 0; i < read.views.size(); ++i) {
    EXPECT_EQ(read.views[i].name, written.views[i].name);
    EXPECT_EQ(read.views[i].psnr_db, written.views[i].psnr_db);
    EXPECT_EQ(read.views[i].ssim, written.views[i].ssim);
    EXPECT_EQ(read.views[i].flip, written.views[i].flip);
    EXPECT_EQ(read.views[i].aligned_psnr_db, written.views[i].aligned_psnr_db);
    EXPECT_EQ(read.views[i].identical, written.views[i].identical);
    EXPECT_EQ(read.views[i].budget, written.views[i].budget);
  }
  EXPECT_EQ(read.WorstFirst(), (std::vector<std::size_t>{1, 0}));
  EXPECT_NE(ReadText(dir / "per_image.csv").find("\"b \"\"1\"\".png\",120.0000,1.000000,0.000000,120.0000\n"),
            std::string::npos);
}

TEST(Scores, DamageIsNamedByFileAndPlace) {
  const TempDir dir;
  EXPECT_ERROR(pipeline::ReadScores(dir.path()), io::ExitCode::kBadInput, "metrics.json");
  pipeline::WriteScores(TwoViews(), dir.path());
  const Json good = io::ParseJson(ReadText(dir / "metrics.json"));
  const struct {
    const char *pointer, *value, *place;
  } kCases[] = {{"/protocol", "4", "protocol"},
                {"/resolution", "[400]", "resolution"},
                {"/psnr", "null", "psnr"},
                {"/masked", "1", "masked"},
                {"/error_budget/sharpness", "null", "error_budget.sharpness"},
                {"/images", "{}", "images"},
                {"/images/1/ssim", "\"0.97\"", "images[1].ssim"}};
  for (const auto& c : kCases) {
    Json bad = good;
    bad[Json::json_pointer(c.pointer)] = io::ParseJson(c.value);
    WriteText(dir / "metrics.json", io::DumpJson(bad));
    EXPECT_ERROR(
        pipeline::ReadScores(dir.path()), io::ExitCode::kBadInput, std::string("metrics.json: ") + c.place);
  }
}

}  // namespace
