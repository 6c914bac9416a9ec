#include "pipeline/report/plot_svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace pipeline {
namespace {

// Drawing area in SVG units; the page scales it to its width.
constexpr double kWidth = 560, kHeight = 300;
constexpr double kLeft = 56, kRight = 12, kTop = 26, kBottom = 44;
constexpr int kTicks = 5;
constexpr double kScatterMargin = 0.05;  // of the range

struct Range {
  double min = std::numeric_limits<double>::infinity(), max = -min;

  void Include(double v) { min = std::min(min, v), max = std::max(max, v); }
  void Widen(double share) {
    const double margin = max > min ? share * (max - min) : share;
    min -= margin, max += margin;
  }
  double Share(double v) const { return max > min ? (v - min) / (max - min) : 0.5; }
};

std::string Number(double v) { return fmt::format("{:.4g}", v); }

std::string Position(double v) { return fmt::format("{:.1f}", v); }

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

// Logarithms of 1, 2 and 5 times the powers of ten; of the powers alone where that would be too many, and of
// the ticks of a linear axis within one decade.
std::vector<double> LogTicks(const Range& range) {
  std::vector<double> ticks;
  if (range.max - range.min < 1) {
    for (const double tick : Ticks({std::pow(10.0, range.min), std::pow(10.0, range.max)}))
      ticks.push_back(std::log10(tick));
    return ticks;
  }
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
  return fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>", x, y, anchor, more, EscapeHtml(text));
}

// Beside the dot, on the side where there is room.
std::string DotLabel(double x, double y, const std::string& label) {
  const bool is_right = x > 0.5 * kWidth;
  return Text(is_right ? x - 4 : x + 4, y - 3, is_right ? "end" : "start", label, " class=\"dot\"");
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
  const auto along_x = [&](double x) { return options.log_x ? std::log10(x) : x; };
  const auto along_y = [&](double y) { return options.log_y ? std::log10(y) : y; };
  const auto is_drawn = [&](double x, double y) {
    return std::isfinite(along_x(x)) && std::isfinite(along_y(y));
  };
  Range x_range, y_range;
  bool anything = false;
  for (const PlotSeries& s : series) {
    int drawn = 0;
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (!is_drawn(s.x[i], s.y[i])) continue;
      x_range.Include(along_x(s.x[i]));
      y_range.Include(along_y(s.y[i]));
      ++drawn;
    }
    anything = anything || drawn >= (options.scatter ? 1 : 2);
  }
  if (!anything) return "";
  // A dot on the frame would be cut in half.
  if (options.scatter) x_range.Widen(kScatterMargin), y_range.Widen(kScatterMargin);
  const auto px = [&](double x) { return kLeft + x_range.Share(x) * (kWidth - kLeft - kRight); };
  const auto py = [&](double y) { return kHeight - kBottom - y_range.Share(y) * (kHeight - kTop - kBottom); };

  std::string svg = "<svg class=\"plot\" viewBox=\"0 0 560 300\" role=\"img\" aria-label=\"" +
                    EscapeHtml(options.y_label) + " over " + EscapeHtml(options.x_label) + "\">";
  for (const double tick : options.log_y ? LogTicks(y_range) : Ticks(y_range)) {
    const std::string y = Position(py(tick));
    svg += "<line class=\"grid\" x1=\"56\" x2=\"548\" y1=\"" + y + "\" y2=\"" + y + "\"/>";
    svg += Text(kLeft - 6, py(tick) + 4, "end", Number(options.log_y ? std::pow(10.0, tick) : tick));
  }
  for (const double tick : options.log_x ? LogTicks(x_range) : Ticks(x_range)) {
    const double x = options.log_x ? std::pow(10.0, tick) : tick;
    svg += Text(px(tick), kHeight - kBottom + 16, "middle", Number(x));
  }
  svg += Text(0.5 * (kLeft + kWidth - kRight), kHeight - 8, "middle", options.x_label);
  svg += Text(kLeft, 14, "start", options.y_label);

  double legend_x = kWidth - kRight;
  for (std::size_t k = series.size(); k-- > 0;) {
    const std::string color = fmt::format(" class=\"series-{}\"", k);
    std::string points, dots;
    for (std::size_t i = 0; i < series[k].x.size(); ++i) {
      const double x = series[k].x[i], y = series[k].y[i];
      if (!is_drawn(x, y)) continue;
      const std::string at_x = Position(px(along_x(x))), at_y = Position(py(along_y(y)));
      points += at_x + "," + at_y + " ";
      dots += "<circle" + color + " cx=\"" + at_x + "\" cy=\"" + at_y + "\" r=\"3\"/>";
      if (i < series[k].point_labels.size())
        dots += DotLabel(px(along_x(x)), py(along_y(y)), series[k].point_labels[i]);
    }
    if (points.empty()) continue;
    svg += options.scatter ? dots : "<polyline" + color + " points=\"" + points + "\"/>";
    if (series.size() > 1) svg += Text(legend_x, 14, "end", series[k].label, color);
    legend_x -= 7.0 * static_cast<double>(series[k].label.size()) + 16;
  }
  return svg + "</svg>";
}

std::string StandaloneSvg(const std::vector<std::string>& plots) {
  const std::string width = Number(kWidth), height = Number(kHeight * static_cast<double>(plots.size()));
  std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + width + " " + height +
                    "\" width=\"" + Number(2 * kWidth) +
                    "\"><style>text{font:13px sans-serif;fill:#555}text.dot{font-size:6px}.grid{stroke:#ddd}"
                    "polyline{fill:none;stroke-width:2}";
  const char* const colors[] = {"#2868c0", "#d07020", "#208050", "#a03080", "#707020", "#c03030"};
  for (std::size_t k = 0; k < std::size(colors); ++k) {
    const std::string name = fmt::format(".series-{}", k), color = colors[k];
    svg +=
        "polyline" + name + "{stroke:" + color + "}circle" + name + ",text" + name + "{fill:" + color + "}";
  }
  svg += "</style><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>";
  for (std::size_t i = 0; i < plots.size(); ++i) {
    if (plots[i].empty()) continue;
    // As a group: many viewers place an <svg> inside another one wrongly.
    const std::size_t begin = plots[i].find('>') + 1, end = plots[i].rfind("</svg>");
    svg += "<g transform=\"translate(0," + Number(kHeight * static_cast<double>(i)) + ")\">" +
           plots[i].substr(begin, end - begin) + "</g>";
  }
  return svg + "</svg>\n";
}

}  // namespace pipeline
