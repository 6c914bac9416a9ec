// Line plots as inline SVG for the report. Colours come from the page's style sheet (classes series-0,
// series-1, ...).
#pragma once

#include <string>
#include <vector>

namespace pipeline {

struct PlotSeries {
  std::string label;
  std::vector<double> x, y;  // points that are not finite are left out
};

struct PlotOptions {
  std::string x_label, y_label;
  bool log_y = false;  // values that are not positive are left out
};

// An <svg> element; empty when no series has two points to draw.
std::string PlotSvg(const std::vector<PlotSeries>& series, const PlotOptions& options);

// & < > " ' as HTML entities.
std::string EscapeHtml(const std::string& text);

}  // namespace pipeline
