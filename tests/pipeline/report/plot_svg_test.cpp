// Plots: what is drawn lies where its values belong, and what cannot be drawn is left out.
#include "pipeline/report/plot_svg.h"

#include <gtest/gtest.h>

#include <cmath>
#include <regex>

namespace {

// The numbers in the group of the first match.
std::vector<double> NumbersOf(const std::string& svg, const std::string& pattern) {
  std::smatch match;
  if (!std::regex_search(svg, match, std::regex(pattern))) return {};
  const std::string text = match[1];
  const std::regex number(R"(-?\d+(\.\d+)?)");
  std::vector<double> numbers;
  for (std::sregex_iterator it(text.begin(), text.end(), number), end; it != end; ++it)
    numbers.push_back(std::stod(it->str()));
  return numbers;
}

TEST(PlotSvg, NeedsTwoFinitePoints) {
  const double nan = std::nan("");
  EXPECT_EQ(pipeline::PlotSvg({{"a", {1}, {2}}}, {"x", "y"}), "");
  EXPECT_EQ(pipeline::PlotSvg({{"a", {1, 2}, {2, nan}}}, {"x", "y"}), "");
  EXPECT_EQ(pipeline::PlotSvg({{"a", {1, 2}, {0, -1}}}, {"x", "y", true}), "");  // no logarithm
  const std::string svg =
      pipeline::PlotSvg({{"a<b", {0, 1, 2}, {5, nan, 7}}, {"c", {0, 2}, {5, 5}}}, {"x", "y"});
  // From the lower left to the upper right end of the grid, the gap left out.
  const std::string kFirst = "", kLast = ".*";  // which line of the grid
  const auto grid = [&](const std::string& which, const std::string& attribute) {
    return NumbersOf(svg, which + "class=\"grid\"[^>]*" + attribute + R"re(="([\d.]+)")re").at(0);
  };
  const std::vector<double> line = NumbersOf(svg, R"re(class="series-0" points="([^"]*)")re");
  EXPECT_EQ(
      line,
      (std::vector<double>{grid(kFirst, "x1"), grid(kFirst, "y1"), grid(kLast, "x2"), grid(kLast, "y1")}))
      << svg;
  EXPECT_LT(line.at(0), line.at(2));
  EXPECT_GT(line.at(1), line.at(3));
  EXPECT_NE(svg.find("a&lt;b"), std::string::npos);
}

}  // namespace
