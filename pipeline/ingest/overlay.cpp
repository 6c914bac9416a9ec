#include "pipeline/ingest/overlay.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "io/process/parallel.h"

namespace pipeline {
namespace {

// Levels of 256 within which a colour is the same: noise, compression.
constexpr int kSame = 12;
constexpr double kStillShare = 0.9;  // of the pictures
// Bars: darker in all channels, lines with so many still pixels, and inner neighbours that differ by so much
// in half of the pictures, over half of their length.
constexpr int kBlack = 48, kContent = 24;
constexpr double kBarLine = 0.99, kContentLine = 0.5;
constexpr double kMaxBar = 0.45;  // of a side; more leaves hardly a picture
// Marks: the median difference of a pixel from its median colour is at least kVaried within kReach pixels of
// most of their edge.
constexpr int kVaried = 16, kReach = 4;
constexpr double kSharpEdge = 0.6;
constexpr int kMinPixels = 12;
constexpr double kMaxCovered = 0.5;
constexpr int kGap = 25;    // closed between letters [px]
constexpr int kMargin = 5;  // around marks, for the blur of their edges [px]

constexpr std::uint8_t kYes = 255;

int MaxDifference(const cv::Vec3b& a, const cv::Vec3b& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

struct Variation {
  cv::Mat median;  // colour of each pixel over the pictures, channel by channel
  cv::Mat still;   // kYes where kStillShare of the pictures have it
  cv::Mat spread;  // median difference from it
};

Variation Measure(const std::vector<io::Image>& pictures, int threads) {
  const int width = pictures[0].width, height = pictures[0].height;
  const std::size_t n = pictures.size();
  Variation variation{
      cv::Mat(height, width, CV_8UC3), cv::Mat(height, width, CV_8U), cv::Mat(height, width, CV_8U)};
  const auto middle = static_cast<std::ptrdiff_t>(n / 2);
  io::ParallelFor(static_cast<std::size_t>(height), threads, [&](std::size_t row) {
    const int y = static_cast<int>(row);
    std::vector<std::uint8_t> values(n);
    std::vector<int> differences(n);
    for (int x = 0; x < width; ++x) {
      cv::Vec3b& median = variation.median.at<cv::Vec3b>(y, x);
      for (int c = 0; c < 3; ++c) {
        for (std::size_t i = 0; i < n; ++i) values[i] = pictures[i].Pixel(x, y)[c];
        std::nth_element(values.begin(), values.begin() + middle, values.end());
        median[c] = values[n / 2];
      }
      for (std::size_t i = 0; i < n; ++i) {
        const std::uint8_t* pixel = pictures[i].Pixel(x, y);
        differences[i] = MaxDifference({pixel[0], pixel[1], pixel[2]}, median);
      }
      const auto same =
          std::count_if(differences.begin(), differences.end(), [](int d) { return d <= kSame; });
      std::nth_element(differences.begin(), differences.begin() + middle, differences.end());
      variation.spread.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(differences[n / 2]);
      variation.still.at<std::uint8_t>(y, x) =
          static_cast<double>(same) >= kStillShare * static_cast<double>(n) ? kYes : 0;
    }
  });
  return variation;
}

// Lines of the picture as seen from one of its sides.
class Side {
 public:
  enum Name { kLeft, kTop, kRight, kBottom };
  Side(Name name, cv::Size size) : name_(name), size_(size) {}

  int lines() const { return IsRow() ? size_.height : size_.width; }
  int length() const { return IsRow() ? size_.width : size_.height; }
  cv::Point At(int line, int along) const {
    const int from_side = name_ == kLeft || name_ == kTop ? line : lines() - 1 - line;
    return IsRow() ? cv::Point(along, from_side) : cv::Point(from_side, along);
  }

 private:
  bool IsRow() const { return name_ == kTop || name_ == kBottom; }
  Name name_;
  cv::Size size_;
};

bool IsBarLine(const Variation& variation, const Side& side, int line) {
  int still = 0;
  for (int along = 0; along < side.length(); ++along) {
    const cv::Point at = side.At(line, along);
    const cv::Vec3b& colour = variation.median.at<cv::Vec3b>(at);
    still += variation.still.at<std::uint8_t>(at) && std::max({colour[0], colour[1], colour[2]}) <= kBlack;
  }
  return still >= kBarLine * side.length();
}

bool IsContentLine(const std::vector<io::Image>& pictures,
                   const Variation& variation,
                   const Side& side,
                   int line) {
  int content = 0;
  for (int along = 0; along < side.length(); ++along) {
    const cv::Point at = side.At(line, along);
    const cv::Vec3b& bar = variation.median.at<cv::Vec3b>(side.At(0, along));
    const auto differing = std::count_if(pictures.begin(), pictures.end(), [&](const io::Image& picture) {
      const std::uint8_t* pixel = picture.Pixel(at.x, at.y);
      return MaxDifference({pixel[0], pixel[1], pixel[2]}, bar) >= kContent;
    });
    content += 2 * static_cast<std::size_t>(differing) >= pictures.size();
  }
  return content >= kContentLine * side.length();
}

int BarOf(const std::vector<io::Image>& pictures, const Variation& variation, Side::Name name) {
  const Side side(name, variation.median.size());
  int line = 0;
  while (line < kMaxBar * side.lines() && IsBarLine(variation, side, line)) ++line;
  // The line after the bar may be half of it.
  if (line == 0 || line >= kMaxBar * side.lines() || !IsContentLine(pictures, variation, side, line + 1))
    return 0;
  return line;
}

bool EndsSharply(const cv::Mat& region, const cv::Mat& varied_near) {
  cv::Mat inner;
  cv::erode(region, inner, cv::Mat());  // beyond the picture counts as region
  const cv::Mat edge = region & ~inner;
  const int n = cv::countNonZero(edge);
  return n > 0 && cv::countNonZero(edge & varied_near) >= kSharpEdge * n;
}

cv::Mat Square(int side) { return cv::getStructuringElement(cv::MORPH_RECT, {side, side}); }

// kYes where a mark lies; `still` has nothing in the bars.
cv::Mat Marks(const cv::Mat& still, const cv::Mat& spread) {
  cv::Mat varied_near, labels, stats, centres;
  cv::dilate(spread >= kVaried, varied_near, Square(2 * kReach + 1));
  const int n = cv::connectedComponentsWithStats(still, labels, stats, centres);
  cv::Mat marks = cv::Mat::zeros(still.size(), CV_8U);
  for (int i = 1; i < n; ++i) {
    if (stats.at<int>(i, cv::CC_STAT_AREA) < kMinPixels) continue;
    // A backdrop around something round, which turns.
    if (stats.at<int>(i, cv::CC_STAT_WIDTH) == still.cols &&
        stats.at<int>(i, cv::CC_STAT_HEIGHT) == still.rows)
      continue;
    // One pixel wider, so that its edge is inside of the picture cut out.
    const cv::Rect box = cv::Rect(stats.at<int>(i, cv::CC_STAT_LEFT) - 1,
                                  stats.at<int>(i, cv::CC_STAT_TOP) - 1,
                                  stats.at<int>(i, cv::CC_STAT_WIDTH) + 2,
                                  stats.at<int>(i, cv::CC_STAT_HEIGHT) + 2) &
                         cv::Rect({0, 0}, still.size());
    const cv::Mat region = labels(box) == i;
    if (EndsSharply(region, varied_near(box))) marks(box).setTo(kYes, region);
  }
  cv::morphologyEx(marks, marks, cv::MORPH_CLOSE, Square(kGap));
  return marks;
}

// And the line next to each bar, which may be half of it.
Bars Widened(const Bars& bars) {
  const auto wider = [](int lines) { return lines > 0 ? lines + 1 : 0; };
  return {.left = wider(bars.left),
          .top = wider(bars.top),
          .right = wider(bars.right),
          .bottom = wider(bars.bottom)};
}

io::Mask MaskWithout(const cv::Mat& marks) {
  const cv::Mat used = ~marks;
  return {used.cols, used.rows, {used.begin<std::uint8_t>(), used.end<std::uint8_t>()}};
}

}  // namespace

Overlay FindOverlay(const std::vector<io::Image>& pictures, int threads) {
  Overlay overlay;
  if (pictures.size() < static_cast<std::size_t>(kMinOverlayPictures)) return overlay;
  Variation variation = Measure(pictures, threads);
  Bars& bars = overlay.bars;
  bars = {.left = BarOf(pictures, variation, Side::kLeft),
          .top = BarOf(pictures, variation, Side::kTop),
          .right = BarOf(pictures, variation, Side::kRight),
          .bottom = BarOf(pictures, variation, Side::kBottom)};
  const cv::Size size = variation.still.size();
  const Bars cut = Widened(bars);
  const cv::Rect content(
      cut.left, cut.top, size.width - cut.left - cut.right, size.height - cut.top - cut.bottom);
  if (content.width <= 0 || content.height <= 0) return {};  // pictures of a few pixels
  const cv::Mat marks = Marks(variation.still(content), variation.spread(content));
  const double covered = cv::countNonZero(marks) / static_cast<double>(marks.total());
  if (covered == 0 || covered > kMaxCovered) return overlay;
  cv::Mat whole = cv::Mat::zeros(size, CV_8U);
  marks.copyTo(whole(content));
  overlay.mask = MaskWithout(whole);
  overlay.covered = covered;
  return overlay;
}

Overlay ResizedOverlay(const Overlay& overlay, int from_width, int from_height, int width, int height) {
  const Bars cut = Widened(overlay.bars);
  const auto scaled = [](int lines, int from, int to) {
    return static_cast<int>(std::ceil(static_cast<double>(lines) * to / from));
  };
  Overlay resized{.bars = {.left = scaled(cut.left, from_width, width),
                           .top = scaled(cut.top, from_height, height),
                           .right = scaled(cut.right, from_width, width),
                           .bottom = scaled(cut.bottom, from_height, height)},
                  .mask = {},
                  .covered = overlay.covered};
  if (overlay.mask.used.empty()) return resized;
  cv::Mat used = cv::Mat(overlay.mask.used, true).reshape(1, overlay.mask.height), full;
  cv::erode(used, used, cv::Mat(), {-1, -1}, kMargin);
  cv::resize(used, full, {width, height}, 0, 0, cv::INTER_NEAREST);
  resized.mask = {width, height, {full.begin<std::uint8_t>(), full.end<std::uint8_t>()}};
  return resized;
}

}  // namespace pipeline
