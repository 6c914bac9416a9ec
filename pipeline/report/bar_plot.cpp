#include "pipeline/report/bar_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "pipeline/report/plot_svg.h"

namespace pipeline {
namespace {

// In SVG units.
constexpr double kWidth = 760, kLeft = 220, kRight = 40, kTop = 44;
constexpr double kBar = 9, kGap = 6;  // height of a bar, and space between groups
constexpr const char* kColors[] = {"#9aa5b1", "#208050", "#d07020", "#2868c0", "#a03080", "#c03030"};

std::string Text(double x, double y, const char* anchor, const char* color, const std::string& text) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\">", x, y, anchor, color) +
         EscapeHtml(text) + "</text>";
}

std::string Legend(const std::vector<std::string>& series) {
  std::string svg;
  double x = kLeft;
  for (std::size_t k = 0; k < series.size(); ++k) {
    svg += Text(x, 32, "start", kColors[k % std::size(kColors)], series[k]);
    x += 8.0 * static_cast<double>(series[k].size()) + 16;
  }
  return svg;
}

}  // namespace

std::string BarPlotSvg(const BarPlot& plot) {
  double longest = 0;
  for (const BarGroup& group : plot.groups) {
    for (const double value : group.values)
      longest = std::isfinite(value) ? std::max(longest, value) : longest;
  }
  if (longest <= 0) return "";
  std::string bars;
  double y = kTop;
  for (const BarGroup& group : plot.groups) {
    const double height = kBar * static_cast<double>(group.values.size());
    bars += Text(kLeft - 6, y + 0.5 * height + 4, "end", "#333", group.label);
    for (std::size_t k = 0; k < group.values.size(); ++k, y += kBar) {
      const double value = group.values[k];
      if (!std::isfinite(value) || value < 0) continue;
      const double width = value / longest * (kWidth - kLeft - kRight);
      bars += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>",
                          kLeft,
                          y,
                          width,
                          kBar - 1,
                          kColors[k % std::size(kColors)]);
      bars += Text(kLeft + width + 3, y + kBar - 2, "start", "#777", fmt::format("{:.0f}", value));
    }
    y += kGap;
  }
  return fmt::format(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0f} {:.0f}\" width=\"{:.0f}\">",
             kWidth,
             y + kGap,
             kWidth) +
         "<style>text{font:11px sans-serif}</style><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>" +
         Text(kLeft, 16, "start", "#333", plot.title) + Legend(plot.series) + bars + "</svg>\n";
}

}  // namespace pipeline
