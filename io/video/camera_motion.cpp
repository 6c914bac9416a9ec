#include "io/video/camera_motion.h"
#include "io/base/median.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace io {
namespace {

constexpr int kWidth = 320;       // enough for 0.1 px = 0.03 % of the width; a few ms per frame
constexpr int kMaxCorners = 200;  // a median needs no more
constexpr int kMinCorners = 8;    // below, nothing can be said about motion
constexpr double kCornerQuality = 0.01;
constexpr double kCornerDistance = 8;                      // [px] spreads the corners over the picture
constexpr double kMinFollowed = 0.4;                       // a smaller share means a cut or a jump
constexpr double kMovingShare = 0.2, kMovingWeight = 0.5;  // of what moves before a still background
constexpr double kAnchorStep = 0.01;                       // [widths]
constexpr double kUnknownStep = 0.05;                      // [widths] a keyframe's worth

}  // namespace

struct CameraMotion::State {
  cv::Mat anchor;
  std::vector<cv::Point2f> corners;
  double anchor_path = 0, path = 0;  // [widths]

  void MoveAnchor(const cv::Mat& grey) {
    anchor = grey;
    anchor_path = path;
    cv::goodFeaturesToTrack(anchor, corners, kMaxCorners, kCornerQuality, kCornerDistance);
  }

  // Displacement from the anchor in widths; negative when too few corners could be followed.
  double Displacement(const cv::Mat& grey) const {
    std::vector<cv::Point2f> found;
    std::vector<unsigned char> ok;
    cv::calcOpticalFlowPyrLK(anchor, grey, corners, found, ok, cv::noArray());
    std::vector<double> lengths;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      if (ok[i]) lengths.push_back(std::hypot(found[i].x - corners[i].x, found[i].y - corners[i].y));
    }
    if (static_cast<double>(lengths.size()) < kMinFollowed * static_cast<double>(corners.size())) return -1;
    const double median = Median(lengths);
    return std::max(median, kMovingWeight * Quantile(std::move(lengths), 1 - kMovingShare)) / kWidth;
  }
};

CameraMotion::CameraMotion() : state_(std::make_unique<State>()) {}
CameraMotion::~CameraMotion() = default;

double CameraMotion::Advance(const Image& frame) {
  const cv::Mat colour(frame.height, frame.width, CV_8UC3, const_cast<std::uint8_t*>(frame.data.data()));
  cv::Mat small, grey;
  const int height = std::max(8, static_cast<int>(std::lround(1.0 * kWidth * frame.height / frame.width)));
  cv::resize(colour, small, {kWidth, height}, 0, 0, cv::INTER_AREA);
  cv::cvtColor(small, grey, cv::COLOR_RGB2GRAY);

  State& s = *state_;
  if (s.anchor.empty() || s.corners.size() < kMinCorners) {
    s.MoveAnchor(grey);
    return s.path;
  }
  const double displacement = s.Displacement(grey);
  const bool lost = displacement < 0;
  s.path = std::max(s.path, s.anchor_path + (lost ? kUnknownStep : displacement));
  if (lost || displacement >= kAnchorStep) s.MoveAnchor(grey);
  return s.path;
}

}  // namespace io
