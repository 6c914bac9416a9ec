// sfm/mapping/refusal.h: what users read of every cause.
#include "sfm/mapping/refusal.h"

#include <gtest/gtest.h>

#include <map>

namespace {

using sfm::RefusalCause;

TEST(Refusal, EveryCauseHasItsName) {
  const std::map<RefusalCause, std::string> names = {
      {RefusalCause::kTooFewPictures, "too few pictures"},
      {RefusalCause::kNoTexture, "no texture"},
      {RefusalCause::kBlur, "blur"},
      {RefusalCause::kNoOverlap, "no overlap"},
      {RefusalCause::kRotationOnly, "no baseline"},
      {RefusalCause::kNarrowRays, "no baseline"},
      {RefusalCause::kPointsOnOneLine, "no consistent model"},
      {RefusalCause::kMisfit, "no consistent model"},
      {RefusalCause::kLargeError, "no consistent model"},
      {RefusalCause::kContradictedPoses, "no consistent model"},
  };
  for (const auto& [cause, name] : names) EXPECT_EQ(sfm::Name(cause), name);
  EXPECT_EQ(names.size(), 10u);
}

TEST(Refusal, TheMessageIsTheSummaryAndARemedyWhereThereIsOne) {
  const sfm::Refusal narrow{RefusalCause::kNarrowRays, "0.5 degrees"};
  EXPECT_EQ(narrow.Summary(), "no baseline: 0.5 degrees");
  EXPECT_TRUE(narrow.Message().starts_with(narrow.Summary() + "; ")) << narrow.Message();
  const sfm::Refusal inaccurate{RefusalCause::kLargeError, "9 px"};
  EXPECT_EQ(inaccurate.Message(), "no consistent model: 9 px");
}

TEST(Refusal, AsAnErrorItKeepsItsCause) {
  const sfm::NotReconstructible error({RefusalCause::kBlur, "3 of 4 pictures"});
  EXPECT_EQ(error.code(), io::ExitCode::kNotReconstructible);
  EXPECT_EQ(error.refusal().cause, RefusalCause::kBlur);
  EXPECT_EQ(std::string(error.what()), error.refusal().Message());
}

}  // namespace
