#include "pipeline/report/budget_section.h"

#include <fmt/format.h>

#include "pipeline/evaluation/error_budget.h"
#include "pipeline/report/plot_svg.h"

namespace pipeline {
namespace {

std::string BudgetRow(const std::string& what, const std::string& figure, const std::string& meaning) {
  return "<tr><td>" + EscapeHtml(what) + "</td><td class=\"n\">" + EscapeHtml(figure) +
         "</td><td class=\"soft\">" + EscapeHtml(meaning) + "</td></tr>\n";
}

}  // namespace

std::string BudgetSection(const Scores& scores) {
  if (!scores.budget) return "";
  const ErrorBudget& budget = *scores.budget;
  const double poses_db = budget.fitted_psnr_db - budget.psnr_db,
               colours_db = budget.fitted_aligned_psnr_db - budget.fitted_psnr_db;
  std::string html = "<h2>Where the error lies</h2>\n<div class=\"scroll\"><table>\n";
  html += BudgetRow("poses",
                    fmt::format("{:+.2f} dB", poses_db),
                    fmt::format("if each unseen view were shown from its own best place, {:.2f} pixels away",
                                budget.moved_px));
  html += BudgetRow(
      "colours", fmt::format("{:+.2f} dB", colours_db), "if exposure and white balance agreed as well");
  html += BudgetRow(
      "few views",
      fmt::format("{:.0f} %", 100 * budget.unseen_error),
      fmt::format("of the squared error, where fewer than {} training views saw the surface: {:.0f} % "
                  "of the pixels",
                  kFewViews,
                  100 * budget.unseen_pixels));
  html += BudgetRow(
      "few pixels",
      fmt::format("{:.0f} %", 100 * budget.worst_error),
      "of the squared error, in the worst 5 % of the pixels of each view: what is in a wrong place");
  html += BudgetRow("detail",
                    fmt::format("{:.0f} %", 100 * budget.sharpness),
                    "of the photographs' squared slopes, in the renders");
  if (scores.training_psnr_db)
    html += BudgetRow("training pictures",
                      fmt::format("{:.2f} dB", *scores.training_psnr_db),
                      "PSNR of pictures that were trained on, in the median: what unseen views could reach");
  html += "</table></div>\n";
  for (const std::string& advice : Advice(scores)) html += "<p>" + EscapeHtml(advice) + ".</p>\n";
  return html;
}

}  // namespace pipeline
