// Bars that compare a few things in many respects, as an SVG file.
#pragma once

#include <string>
#include <vector>

namespace pipeline {

struct BarGroup {
  std::string label;
  std::vector<double> values;  // one per series; what is not finite has no bar
};

struct BarPlot {
  std::string title;
  std::vector<std::string> series;  // at most 6
  std::vector<BarGroup> groups;     // from top to bottom
};

// A whole SVG file: horizontal bars from 0, a group per row, the values written beside them. Empty without a
// positive value.
std::string BarPlotSvg(const BarPlot& plot);

}  // namespace pipeline
