#include "pipeline/plot_svg.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace pipeline {
namespace {

// Drawing area in SVG units; the page scales it to its width.
constexpr double kWidth = 560, kHeight = 300;
constexpr double kLeft = 56, kRight = 12, kTop = 26, kBottom = 44;
constexpr int kTicks = 5;

struct Range {
  double min = std::numeric_limits<double>::infinity(), max = -min;

  void Include(double v) { min = std::min(min, v), max = std::max(max, v); }
  double Share(double v) const { return max > min ? (v - min) / (max - min) : 0.5; }
};

std::string Number(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", v);
  return text;
}

std::string Position(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", v);
  return text;
}

// 1, 2 or 5 times a power of ten, so that about kTicks steps fill the range.
double TickStep(const Range& range) {
  const double raw = (range.max - range.min) / kTicks;
  if (!(raw > 0)) return 1;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (raw <= factor * power) return factor * power;
  }
  return 10 * power;
}

std::vector<double> Ticks(const Range& range) {
  const double step = TickStep(range);
  std::vector<double> ticks;
  for (double k = std::ceil(range.min / step); k * step <= range.max; ++k) ticks.push_back(k * step);
  return ticks;
}

// Logarithms of 1, 2 and 5 times the powers of ten; of the powers alone where that would be too many.
std::vector<double> LogTicks(const Range& range) {
  std::vector<double> ticks;
  for (double power = std::floor(range.min); power <= range.max; ++power) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double tick = power + std::log10(factor);
      const bool drawn = factor == 1.0 || range.max - range.min < 0.5 * kTicks;
      if (drawn && tick >= range.min && tick <= range.max) ticks.push_back(tick);
    }
  }
  return ticks;
}

std::string Text(
    double x, double y, const char* anchor, const std::string& text, const std::string& more = "") {
  return "<text x=\"" + Position(x) + "\" y=\"" + Position(y) + "\" text-anchor=\"" + anchor + "\"" + more +
         ">" + EscapeHtml(text) + "</text>";
}

}  // namespace

std::string EscapeHtml(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string PlotSvg(const std::vector<PlotSeries>& series, const PlotOptions& options) {
  const auto height_of = [&](double y) { return options.log_y ? std::log10(y) : y; };
  const auto is_drawn = [&](double x, double y) { return std::isfinite(x) && std::isfinite(height_of(y)); };
  Range x_range, y_range;
  bool any_line = false;
  for (const PlotSeries& s : series) {
    int drawn = 0;
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (!is_drawn(s.x[i], s.y[i])) continue;
      x_range.Include(s.x[i]);
      y_range.Include(height_of(s.y[i]));
      ++drawn;
    }
    any_line = any_line || drawn >= 2;
  }
  if (!any_line) return "";
  const auto px = [&](double x) { return kLeft + x_range.Share(x) * (kWidth - kLeft - kRight); };
  const auto py = [&](double y) { return kHeight - kBottom - y_range.Share(y) * (kHeight - kTop - kBottom); };

  std::string svg = "<svg class=\"plot\" viewBox=\"0 0 560 300\" role=\"img\" aria-label=\"" +
                    EscapeHtml(options.y_label) + " over " + EscapeHtml(options.x_label) + "\">";
  for (const double tick : options.log_y ? LogTicks(y_range) : Ticks(y_range)) {
    const std::string y = Position(py(tick));
    svg += "<line class=\"grid\" x1=\"56\" x2=\"548\" y1=\"" + y + "\" y2=\"" + y + "\"/>";
    svg += Text(kLeft - 6, py(tick) + 4, "end", Number(options.log_y ? std::pow(10.0, tick) : tick));
  }
  for (const double tick : Ticks(x_range))
    svg += Text(px(tick), kHeight - kBottom + 16, "middle", Number(tick));
  svg += Text(0.5 * (kLeft + kWidth - kRight), kHeight - 8, "middle", options.x_label);
  svg += Text(kLeft, 14, "start", options.y_label);

  double legend_x = kWidth - kRight;
  for (std::size_t k = series.size(); k-- > 0;) {
    const std::string color = " class=\"series-" + std::to_string(k) + "\"";
    std::string points;
    for (std::size_t i = 0; i < series[k].x.size(); ++i) {
      const double x = series[k].x[i], y = series[k].y[i];
      if (is_drawn(x, y)) points += Position(px(x)) + "," + Position(py(height_of(y))) + " ";
    }
    if (points.empty()) continue;
    svg += "<polyline" + color + " points=\"" + points + "\"/>";
    if (series.size() > 1) svg += Text(legend_x, 14, "end", series[k].label, color);
    legend_x -= 7.0 * static_cast<double>(series[k].label.size()) + 16;
  }
  return svg + "</svg>";
}

}  // namespace pipeline
