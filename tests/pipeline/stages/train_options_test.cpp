// pipeline/stages/train_options.h and train_preset.h: what the flags of `pipeline train` resolve to.
#include "pipeline/stages/train_options.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "nerf/kernels/kernels.h"
#include "pipeline/stages/train_preset.h"

namespace pipeline {
namespace {

nerf::TrainOptions Resolve(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "pipeline train");
  TrainFlags flags;
  Options options("pipeline train", "Tests.");
  AddTrainOptions(&options, &flags);
  EXPECT_TRUE(options.Parse(static_cast<int>(arguments.size()), arguments.data()));
  ApplyPreset(static_cast<int>(arguments.size()), arguments.data(), &options, &flags);
  return ResolvedTrainOptions(options, flags);
}

TEST(TrainOptions, PrecisionOfTheHashField) {
  struct Case {
    const char* flag;
    bool table, network;
  };
  const bool bf16 = nerf::kernels::HasBf16Products();
  for (const Case& c : {Case{"--precision=fp32", false, false},
                        {"--precision=bf16-table", true, false},
                        {"--precision=bf16-network", false, true},
                        {"--precision=bf16", true, true},
                        {"--precision=auto", bf16, bf16}}) {
    const nerf::SceneFieldOptions field = Resolve({c.flag}).field;
    EXPECT_EQ(field.bf16_table, c.table) << c.flag;
    EXPECT_EQ(field.bf16_network, c.network) << c.flag;
  }
}

TEST(TrainOptions, UnknownPrecisionIsNamed) {
  for (const char* field : {"--field=hash", "--field=nerf"}) {
    try {
      Resolve({field, "--precision=fp8"});
      FAIL() << field;
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), io::ExitCode::kUsage);
      EXPECT_NE(std::string(error.what()).find("--precision: 'fp8'"), std::string::npos) << error.what();
    }
  }
  EXPECT_THROW(Resolve({"--field=nerf", "--precision=bf16-table"}), io::Error);
}

TEST(TrainOptions, ThePresetIsThatOfTheReportAndFlagsWin) {
  const nerf::TrainOptions report = nerf::ReportTrainOptions(), train = Resolve({"--preset=report"});
  EXPECT_EQ(train.field.kind, nerf::FieldKind::kMlp);
  EXPECT_EQ(train.steps, report.steps);
  EXPECT_EQ(train.field.mlp.quadrature.n_samples, report.field.mlp.quadrature.n_samples);
  EXPECT_EQ(train.field.mlp.density, nerf::DensityActivation::kRelu);
  EXPECT_EQ(train.field.mlp.initialisation, nerf::Initialisation::kUniform);
  EXPECT_TRUE(train.field.mlp.scene_units);
  EXPECT_EQ(train.field.mlp.bf16,
            nerf::PrefersBf16("cpu"));  // widened to float, a step takes ten times as long
  EXPECT_EQ(Resolve({"--preset=report", "--steps=5"}).steps, 5);
  EXPECT_EQ(Resolve({"--preset=report", "--time=1m"}).steps, 0);  // a time that was asked for
  EXPECT_FALSE(Resolve({"--preset=report", "--precision=fp32"}).field.mlp.bf16);
}

TEST(TrainOptions, WhatDoesNotGoTogetherIsRefused) {
  EXPECT_THROW(Resolve({"--open-end"}), io::Error);
  EXPECT_THROW(Resolve({"--importance-samples=64"}), io::Error);
  EXPECT_THROW(Resolve({"--encoding-space=scene"}), io::Error);
  EXPECT_THROW(Resolve({"--no-encoding-identity", "--position-frequencies=0"}), io::Error);
  EXPECT_THROW(Resolve({"--target=30dB", "--steps=5"}), io::Error);
  EXPECT_THROW(Resolve({"--target=30dB", "--field=nerf"}), io::Error);
}

TEST(TrainOptions, BatchAndRateAreTheFieldsOwnUnlessGiven) {
  EXPECT_EQ(Resolve({}).samples_per_step, nerf::TrainOptions().samples_per_step);
  EXPECT_EQ(Resolve({"--batch=4096"}).samples_per_step, 4096);
  EXPECT_EQ(nerf::ScheduleOf(Resolve({"--learning-rate=0.5"}), true).learning_rate, 0.5);
}

}  // namespace
}  // namespace pipeline
