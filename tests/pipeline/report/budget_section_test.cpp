// What the report says about the error of unseen views.
#include "pipeline/report/budget_section.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace {

using testing::HasSubstr;
using testing::Not;

TEST(BudgetSection, ShowsFiguresAndAdvice) {
  pipeline::Scores scores;
  EXPECT_EQ(pipeline::BudgetSection(scores), "");
  scores.views = {{.name = "a&b.jpg", .budget = {{.unseen_error = 0.5}}}};
  scores.budget = {.psnr_db = 28,
                   .fitted_psnr_db = 28.25,
                   .fitted_aligned_psnr_db = 28.35,
                   .moved_px = 0.42,
                   .sharpness = 0.81,
                   .worst_error = 0.53,
                   .unseen_pixels = 0.06,
                   .unseen_error = 0.31};
  const std::string html = pipeline::BudgetSection(scores);
  for (const char* text :
       {"+0.25 dB", "+0.10 dB", "0.42 pixels", "31 %", "6 % of the pixels", "53 %", "81 %"})
    EXPECT_THAT(html, HasSubstr(text));
  EXPECT_THAT(html, Not(HasSubstr("training pictures</td>")));  // their PSNR is not known
  EXPECT_THAT(html, HasSubstr("Photograph more around what a&amp;b.jpg show"));
}

}  // namespace
