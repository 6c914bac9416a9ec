// Plots as inline SVG for the report, or as a file of their own. Colours come from the page's style sheet
// (classes series-0, series-1, ...).
#pragma once

#include <string>
#include <vector>

namespace pipeline {

struct PlotSeries {
  std::string label;
  std::vector<double> x, y;               // points that are not finite are left out
  std::vector<std::string> point_labels;  // beside the points of a scatter plot; may be empty
};

struct PlotOptions {
  std::string x_label, y_label;
  bool log_y = false;    // values that are not positive are left out
  bool log_x = false;    // the same
  bool scatter = false;  // dots instead of a line
};

// An <svg> element; empty when no series has two points to draw (one point, in a scatter plot).
std::string PlotSvg(const std::vector<PlotSeries>& series, const PlotOptions& options);

// A whole SVG file with the plots below each other, in colours of its own for up to 6 series.
std::string StandaloneSvg(const std::vector<std::string>& plots);

// & < > " ' as HTML entities.
std::string EscapeHtml(const std::string& text);

}  // namespace pipeline
