// Evaluation: known errors give known scores, files can be scored again, and nothing wrong is averaged away.
#include "pipeline/evaluation/evaluation.h"
#include "io/base/json.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/image/mask.h"
#include "nerf/metrics/metrics.h"
#include "tests/support/scenes/sphere_field.h"

namespace {

namespace fs = std::filesystem;
using pipeline::Scores;
using tests::SphereField;

class EvaluationTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("evaluation test " + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "truth");
    scene_ = tests::RingScene(
        4, 60, 44, [&](int i) { return folder_ / "truth" / ("view \"" + std::to_string(i) + "\".png"); });
    WriteTruth(SphereField());
  }
  void TearDown() override { fs::remove_all(folder_); }

  void WriteTruth(const SphereField& field) {
    for (const io::Frame& frame : scene_.frames) {
      io::WriteImage(frame.image_path,
                     pipeline::QuantizeView(field.Render(scene_.cameras[0], frame.world_from_cam, {})));
    }
  }

  Scores Score(const nerf::TrainedField& field, int threads = 1, int max_strips = 24) {
    pipeline::RenderViews(field, scene_, folder_, threads);
    return pipeline::ScoreViews(scene_, folder_, {.max_strips = max_strips, .threads = threads});
  }

  io::ExitCode CodeOf(const std::function<void()>& body) {
    try {
      body();
    } catch (const io::Error& error) {
      message_ = error.what();
      return error.code();
    }
    return io::ExitCode::kOk;
  }

  fs::path folder_;
  io::Scene scene_;
  std::string message_;
};

// As in films: the field under splats with half the sides.
TEST_F(EvaluationTest, ViewsAreDrawnAsFramesOfFilmsAre) {
  const SphereField field;
  Score(field);
  EXPECT_EQ(field.last_options.field_focal_px, 0.5 * scene_.cameras[0].fl_x);
  EXPECT_TRUE(field.last_options.splats);
}

// A mean squared error of 0 has no PSNR: the figure is capped, so that means and JSON stay finite.
TEST_F(EvaluationTest, PerfectFieldIsIdenticalAndFinite) {
  Scores result = Score(SphereField());
  result.protocol = "capture";
  ASSERT_EQ(result.views.size(), 4u);
  EXPECT_EQ(result.psnr_db, nerf::kMaxPsnrDb);
  EXPECT_NEAR(result.ssim, 1, 1e-12);
  EXPECT_EQ(result.flip, 0);
  for (const auto& view : result.views) EXPECT_TRUE(view.identical);
  pipeline::WriteScores(result, folder_);
  const auto json = io::ParseJson(io::ReadFile(folder_ / "metrics.json"));
  EXPECT_EQ(json["protocol"], "capture");
  EXPECT_EQ(json["images"].size(), 4u);
  EXPECT_EQ(json["images"][1]["name"], "view \"1\".png");
  EXPECT_EQ(json["images"][1]["identical"], true);
  EXPECT_TRUE(json["psnr"].is_number());
}

TEST_F(EvaluationTest, KnownShadeGivesItsPsnr) {
  const Scores result = Score(SphereField(10.f / 255));  // nothing saturates: brightest is 0.8
  EXPECT_NEAR(result.psnr_db, 20 * std::log10(255.0 / 10), 1e-6);
  EXPECT_NEAR(result.psnr_of_mean_mse_db, result.psnr_db, 1e-6);
  EXPECT_LT(result.ssim, 1);
  EXPECT_GT(result.flip, 0.01);
}

// Cutting off instead of rounding would darken every render by half a grey level.
TEST_F(EvaluationTest, RoundsToNearest) {
  nerf::RenderedView view{
      2, 1, {0.5f / 255 - 1e-4f, 0.5f / 255 + 1e-4f, -3.f, 2.f, 1.f, 254.6f / 255}, {0, 0}, {0, 0}};
  EXPECT_EQ(pipeline::QuantizeView(view).data, (std::vector<std::uint8_t>{0, 1, 0, 255, 255, 255}));
}

// Cast to a byte, NaN would pass for black.
TEST_F(EvaluationTest, NotFiniteIsAnErrorThatNamesThePixel) {
  nerf::RenderedView view{2, 1, std::vector<float>(6, 0.5f), {0, 0}, {0, 0}};
  view.rgb[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(CodeOf([&] { pipeline::QuantizeView(view); }), io::ExitCode::kBadInput);
  EXPECT_NE(message_.find("(1, 0)"), std::string::npos) << message_;
}

TEST_F(EvaluationTest, ComparisonsAreRankedWorstFirst) {
  // The third truth is spoiled, so its view is the worst.
  io::Image spoiled = io::ReadImage(scene_.frames[2].image_path);
  for (std::uint8_t& v : spoiled.data) v = static_cast<std::uint8_t>(255 - v);
  io::WriteImage(scene_.frames[2].image_path, spoiled);
  const Scores result = Score(SphereField(), 2, 2);
  EXPECT_EQ(result.WorstFirst()[0], 2u);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "compare"), fs::directory_iterator()), 2 * 3);
  const pipeline::Comparison worst = pipeline::ComparisonPaths(folder_, 1, 4, "view \"2\".png");
  EXPECT_EQ(worst.photo, folder_ / "compare" / "01_view \"2\"_photo.png");
  EXPECT_EQ(io::ReadImage(worst.photo).data, spoiled.data);
  EXPECT_EQ(io::ReadImage(worst.render).data, io::ReadImage(folder_ / "renders" / "view \"2\".png").data);
  // Black, in magma (0, 0, 4) at most, where nothing is wrong, and lighter where more is: the background is
  // off by 25 grey levels, the sphere's chequers by up to 153.
  const std::string second = result.views[result.WorstFirst()[1]].name;
  const io::Image error = io::ReadImage(worst.error),
                  none = io::ReadImage(pipeline::ComparisonPaths(folder_, 2, 4, second).error);
  for (const io::Image& image : {error, none}) {
    EXPECT_EQ(image.width, 60);
    EXPECT_EQ(image.height, 44);
  }
  for (std::size_t i = 0; i < none.data.size(); ++i) EXPECT_LE(none.data[i], i % 3 < 2 ? 0 : 4) << i;
  EXPECT_GT(error.Pixel(2, 20)[0], 50);
  EXPECT_GT(error.Pixel(30, 20)[0], error.Pixel(2, 20)[0] + 50);
  EXPECT_EQ(pipeline::ComparisonPaths(folder_, 1, 100, "a.jpg").error.filename(), "001_a_error.png");
}

TEST_F(EvaluationTest, ThreadsDoNotMatter) {
  const Scores one = Score(SphereField(0.03f), 1), three = Score(SphereField(0.03f), 3);
  EXPECT_EQ(one.psnr_db, three.psnr_db);
  EXPECT_EQ(one.ssim, three.ssim);
  EXPECT_EQ(one.flip, three.flip);
}

TEST_F(EvaluationTest, FinishedRendersAreKept) {
  const SphereField field;
  pipeline::RenderViews(field, scene_, folder_, 1);
  fs::remove(folder_ / "renders" / "view \"1\".png");
  field.n_renders = 0;
  pipeline::RenderViews(field, scene_, folder_, 1);
  EXPECT_EQ(field.n_renders, 1);
}

TEST_F(EvaluationTest, MasksDecideWhatIsScoredAndShowInComparisons) {
  // Truths are spoiled left of column 15; the masks use what lies right of column 30, out of reach of SSIM's
  // and FLIP's windows. The last view has no mask and is whole.
  io::Mask mask{60, 44, {}};
  for (int i = 0; i < 60 * 44; ++i) mask.used.push_back(i % 60 >= 30 ? 255 : 0);
  io::WriteMask(folder_ / "mask.png", mask);
  for (std::size_t v = 0; v < 3; ++v) {
    io::Frame& frame = scene_.frames[v];
    io::Image spoiled = io::ReadImage(frame.image_path);
    for (std::size_t i = 0; i < spoiled.data.size(); ++i) {
      if (i / 3 % 60 < 15) spoiled.data[i] = static_cast<std::uint8_t>(255 - spoiled.data[i]);
    }
    io::WriteImage(frame.image_path, spoiled);
    frame.mask_path = folder_ / "mask.png";
  }
  const Scores result = Score(SphereField());
  EXPECT_TRUE(result.masked);
  for (const auto& view : result.views) {
    EXPECT_TRUE(view.identical);
    EXPECT_NEAR(view.ssim, 1, 1e-12);
    EXPECT_EQ(view.flip, 0);
  }
  pipeline::WriteScores(result, folder_);
  EXPECT_EQ(io::ParseJson(io::ReadFile(folder_ / "metrics.json"))["masked"], true);
  const pipeline::Comparison shown = pipeline::ComparisonPaths(folder_, 1, 4, "view \"0\".png");
  const io::Image shown_photo = io::ReadImage(shown.photo), shown_render = io::ReadImage(shown.render),
                  shown_error = io::ReadImage(shown.error),
                  truth = io::ReadImage(scene_.frames[0].image_path),
                  render = io::ReadImage(folder_ / "renders" / "view \"0\".png");
  for (int x = 0; x < 60; ++x) {
    const int darkening = x < 30 ? 4 : 1;
    for (int c = 0; c < 3; ++c) {
      EXPECT_EQ(shown_photo.Pixel(x, 20)[c], truth.Pixel(x, 20)[c] / darkening) << x;
      EXPECT_EQ(shown_render.Pixel(x, 20)[c], render.Pixel(x, 20)[c] / darkening) << x;
      EXPECT_LE(shown_error.Pixel(x, 20)[c], 255 / darkening) << x;
    }
  }
  for (io::Frame& frame : scene_.frames) frame.mask_path.clear();
  const Scores whole = Score(SphereField());
  EXPECT_FALSE(whole.masked);
  EXPECT_LT(whole.views[0].psnr_db, 30);
  pipeline::WriteScores(whole, folder_);
  EXPECT_FALSE(io::ParseJson(io::ReadFile(folder_ / "metrics.json")).contains("masked"));
}

// Scored against transparent black, the background of NeRF-synthetic pictures would count as an error.
TEST_F(EvaluationTest, AlphaIsScoredOnWhite) {
  for (const io::Frame& frame : scene_.frames) {
    io::Image truth = io::MakeImage(60, 44, 4);  // all transparent black
    io::WriteImage(frame.image_path, truth);
  }
  pipeline::RenderViews(SphereField(), scene_, folder_, 1);
  io::Image white = io::MakeImage(60, 44, 3);
  for (std::uint8_t& v : white.data) v = 255;
  for (const io::Frame& frame : scene_.frames) {
    io::WriteImage(folder_ / "renders" / frame.image_path.filename(), white);
  }
  const Scores result = pipeline::ScoreViews(scene_, folder_, {});
  EXPECT_TRUE(result.white_background);
  EXPECT_TRUE(result.views[0].identical);
}

// The truth's own composite on white is perfect, on any other background it is not, and the file
// says which background was used.
TEST_F(EvaluationTest, BackgroundOfTheProtocolIsRecordedAndMatters) {
  pipeline::RenderViews(SphereField(), scene_, folder_, 1);
  const auto score_on = [&](std::uint8_t background) {
    for (const io::Frame& frame : scene_.frames) {
      io::Image truth = io::MakeImage(60, 44, 4);
      for (std::size_t i = 0; i < truth.data.size(); ++i)
        truth.data[i] = static_cast<std::uint8_t>(i * 7 / 4);
      io::WriteImage(frame.image_path, truth);
      io::WriteImage(folder_ / "renders" / frame.image_path.filename(), io::CompositeOn(truth, background));
    }
    const Scores result = pipeline::ScoreViews(scene_, folder_, {});
    pipeline::WriteScores(result, folder_);
    return result.psnr_db;
  };
  EXPECT_LT(score_on(0), 10);
  EXPECT_EQ(score_on(255), nerf::kMaxPsnrDb);
  auto json = io::ParseJson(io::ReadFile(folder_ / "metrics.json"));
  EXPECT_TRUE(json["background"].get<std::string>().starts_with("white, straight alpha")) << json;
  EXPECT_TRUE(json["rounding"].get<std::string>().starts_with("8-bit sRGB, nearest")) << json;
  WriteTruth(SphereField());
  pipeline::WriteScores(pipeline::ScoreViews(scene_, folder_, {}), folder_);
  json = io::ParseJson(io::ReadFile(folder_ / "metrics.json"));
  EXPECT_EQ(json["background"], "none");
}

TEST_F(EvaluationTest, WhatCannotBeScoredIsAnError) {
  const auto score = [&] { pipeline::ScoreViews(scene_, folder_, {}); };
  pipeline::RenderViews(SphereField(), scene_, folder_, 1);
  const fs::path render = folder_ / "renders" / "view \"3\".png";
  io::WriteImage(render, io::MakeImage(59, 44, 3));
  EXPECT_EQ(CodeOf(score), io::ExitCode::kBadInput);
  EXPECT_NE(message_.find("59x44 pixels, its truth has 60x44"), std::string::npos) << message_;
  fs::remove(render);
  EXPECT_EQ(CodeOf(score), io::ExitCode::kBadInput);
  EXPECT_NE(message_.find(render.string()), std::string::npos) << message_;
  EXPECT_NE(message_.find("missing"), std::string::npos) << message_;

  io::Scene empty = scene_;
  empty.frames.clear();
  EXPECT_EQ(CodeOf([&] { pipeline::ScoreViews(empty, folder_, {}); }), io::ExitCode::kBadInput);
  EXPECT_NE(message_.find("no held-out view to score"), std::string::npos) << message_;
  io::Scene distorted = scene_;
  distorted.cameras[0].k1 = 0.1;
  EXPECT_EQ(CodeOf([&] { pipeline::RenderViews(SphereField(), distorted, folder_, 1); }),
            io::ExitCode::kBadInput);
  io::Scene narrow = scene_;
  narrow.cameras[0].width = 30;
  fs::remove_all(folder_ / "renders");
  EXPECT_EQ(CodeOf([&] { pipeline::RenderViews(SphereField(), narrow, folder_, 1); }),
            io::ExitCode::kBadInput);
  EXPECT_NE(message_.find("60x44 pixels, its camera has 30x44"), std::string::npos) << message_;
  io::Scene twins = scene_;
  twins.frames[1].image_path = twins.frames[0].image_path;
  EXPECT_EQ(CodeOf([&] { pipeline::RenderViews(SphereField(), twins, folder_, 1); }),
            io::ExitCode::kBadInput);
}

}  // namespace
