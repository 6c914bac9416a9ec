#include "sfm/scene/moving_subject.h"

#include <algorithm>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/base/error.h"
#include "io/process/parallel.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

constexpr int kSide = 512;            // longer side at which pictures are compared, in pixels
constexpr std::size_t kSampled = 48;  // pictures among which a pixel's most frequent colour is sought
// Levels of 256 within which a colour counts as the same: noise, compression, the flicker of a lamp.
constexpr int kTolerance = 16;
// So many of the pictures must agree on the colour of a background that the subject covers now and then.
// Where nearly all do, it may be a subject that looks the same all the way round.
constexpr double kKnownShare = 0.2, kSameShare = 0.95;
// Of the picture: less or more than this is no subject.
constexpr double kMinMovingShare = 0.005, kMaxMovingShare = 0.8;
// Regions smaller than this share of the largest are noise, a curtain, a clock.
constexpr double kMinRegionShare = 0.1;
// At the size of comparison: specks of 2 pixels go, and gaps of 4 close, between points of 16. What points
// within 16 pixels enclose may be the subject, as may what lies 10 pixels from a point, and 2 pixels on
// either side of its edge may be either.
constexpr int kOpening = 3, kClosing = 5, kBetweenPoints = 17, kAroundPoint = 33, kBesidePoint = 21,
              kEdge = 5;

constexpr std::size_t kMinObservers = 3;  // of a point: two rays always meet

constexpr std::uint8_t kYes = 255;

cv::Mat ReadSmall(const fs::path& path, cv::Size* full) {
  const cv::Mat picture = cv::imread(path.string(), cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (picture.empty()) {
    throw io::Error(io::ExitCode::kBadInput,
                    path.string() + ": cannot be read as a picture",
                    "Run pipeline ingest again");
  }
  *full = picture.size();
  const double scale = std::min(1.0, static_cast<double>(kSide) / std::max(picture.cols, picture.rows));
  const cv::Size size(std::max(1, cvRound(picture.cols * scale)), std::max(1, cvRound(picture.rows * scale)));
  cv::Mat small;
  cv::resize(picture, small, size, 0, 0, cv::INTER_AREA);
  return small;
}

bool Same(const cv::Vec3b& a, const cv::Vec3b& b) {
  return std::abs(a[0] - b[0]) <= kTolerance && std::abs(a[1] - b[1]) <= kTolerance &&
         std::abs(a[2] - b[2]) <= kTolerance;
}

struct Background {
  cv::Mat colour;  // most frequent
  cv::Mat known;   // kYes where that colour is a background's
  cv::Mat same;    // kYes where hardly any picture has another
};

Background FindBackground(const std::vector<cv::Mat>& pictures, int threads) {
  std::vector<const cv::Mat*> sampled;
  const std::size_t n = std::min(kSampled, pictures.size());
  for (std::size_t i = 0; i < n; ++i) sampled.push_back(&pictures[i * pictures.size() / n]);
  const cv::Size size = pictures[0].size();
  Background background{cv::Mat(size, CV_8UC3), cv::Mat(size, CV_8U), cv::Mat(size, CV_8U)};
  io::ParallelFor(static_cast<std::size_t>(size.height), threads, [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < size.width; ++x) {
      std::ptrdiff_t most = 0;
      for (const cv::Mat* candidate : sampled) {
        const cv::Vec3b& colour = candidate->at<cv::Vec3b>(y, x);
        const auto same = std::count_if(sampled.begin(), sampled.end(), [&](const cv::Mat* other) {
          return Same(colour, other->at<cv::Vec3b>(y, x));
        });
        if (same <= most) continue;
        most = same;
        background.colour.at<cv::Vec3b>(y, x) = colour;
      }
      const double share = static_cast<double>(most) / static_cast<double>(n);
      background.known.at<std::uint8_t>(y, x) = share >= kKnownShare ? kYes : 0;
      background.same.at<std::uint8_t>(y, x) = share >= kSameShare ? kYes : 0;
    }
  });
  return background;
}

cv::Mat Square(int side) { return cv::getStructuringElement(cv::MORPH_RECT, {side, side}); }

// Clears the regions of `mask` smaller than kMinRegionShare of the largest.
void DropSmallRegions(cv::Mat* mask) {
  cv::Mat labels, stats, centres;
  const int n = cv::connectedComponentsWithStats(*mask, labels, stats, centres);
  int largest = 0;
  for (int i = 1; i < n; ++i) largest = std::max(largest, stats.at<int>(i, cv::CC_STAT_AREA));
  for (int i = 1; i < n; ++i) {
    if (stats.at<int>(i, cv::CC_STAT_AREA) < kMinRegionShare * largest) mask->setTo(0, labels == i);
  }
}

// What `mask` encloses: all outside of it that is not connected with the picture's border.
cv::Mat Enclosed(const cv::Mat& mask) {
  cv::Mat labels;
  const int n = cv::connectedComponents(~mask, labels, 4);
  std::vector<bool> at_border(static_cast<std::size_t>(n), false);
  const auto mark = [&](int y, int x) { at_border[static_cast<std::size_t>(labels.at<int>(y, x))] = true; };
  for (int y = 0; y < mask.rows; ++y) mark(y, 0), mark(y, mask.cols - 1);
  for (int x = 0; x < mask.cols; ++x) mark(0, x), mark(mask.rows - 1, x);
  cv::Mat enclosed = cv::Mat::zeros(mask.size(), CV_8U);
  for (int i = 1; i < n; ++i) {
    if (!at_border[static_cast<std::size_t>(i)]) enclosed.setTo(kYes, labels == i);
  }
  return enclosed;
}

// kYes where frame `index` sees the subject for sure: at each point, of the far side as well, for it is the
// subject that hides it. Of the size of comparison.
cv::Mat SubjectPoints(const io::Scene& scene, int index, cv::Size size) {
  const io::Frame& frame = scene.frames[static_cast<std::size_t>(index)];
  const io::Camera camera =
      io::ResizedCamera(scene.cameras[static_cast<std::size_t>(frame.camera_index)], size.width, size.height);
  const io::Rigid3d cam_from_world = frame.world_from_cam.Inverse();
  cv::Mat points(size, CV_8U, cv::Scalar(0));
  for (const io::Point3D& point : scene.points) {
    if (point.frame_indices.size() < kMinObservers) continue;
    const auto xy = io::ImgFromCam(camera, cam_from_world * point.xyz);
    if (!xy || !(xy->x() >= 0 && xy->y() >= 0 && xy->x() < size.width && xy->y() < size.height)) continue;
    points.at<std::uint8_t>(static_cast<int>(xy->y()), static_cast<int>(xy->x())) = kYes;
  }
  return points;
}

// Where the most frequent colour is the subject's, since points lie there in most of the pictures that have
// it, no colour is known to be the background's.
void ForgetSubject(const std::vector<cv::Mat>& pictures,
                   const std::vector<cv::Mat>& among,
                   Background* background) {
  for (int y = 0; y < background->known.rows; ++y) {
    for (int x = 0; x < background->known.cols; ++x) {
      int with_points = 0, without = 0;
      for (std::size_t i = 0; i < pictures.size(); ++i) {
        if (!Same(pictures[i].at<cv::Vec3b>(y, x), background->colour.at<cv::Vec3b>(y, x))) continue;
        among[i].at<std::uint8_t>(y, x) ? ++with_points : ++without;
      }
      if (with_points > without) background->known.at<std::uint8_t>(y, x) = 0;
    }
  }
}

// What lies among points, which are at most 16 pixels apart.
cv::Mat AmongPoints(const cv::Mat& points) {
  cv::Mat among;
  cv::morphologyEx(points, among, cv::MORPH_CLOSE, Square(kBetweenPoints));
  return among;
}

io::Mask MaskOf(const cv::Mat& mask) {
  return {mask.cols, mask.rows, {mask.begin<std::uint8_t>(), mask.end<std::uint8_t>()}};
}

MovingSubject Subject(const cv::Mat& picture,
                      const cv::Mat& points,
                      const cv::Mat& among,
                      const Background& background) {
  cv::Mat shown(picture.size(), CV_8U);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const bool is_background = background.known.at<std::uint8_t>(y, x) &&
                                 Same(picture.at<cv::Vec3b>(y, x), background.colour.at<cv::Vec3b>(y, x));
      shown.at<std::uint8_t>(y, x) = is_background ? 0 : kYes;
    }
  }
  cv::morphologyEx(shown, shown, cv::MORPH_OPEN, Square(kOpening));
  cv::morphologyEx(shown, shown, cv::MORPH_CLOSE, Square(kClosing));
  const cv::Mat contradicted = among & ~shown;
  shown |= among;
  cv::Mat around, beside;
  cv::dilate(points, around, Square(kAroundPoint));
  cv::dilate(points, beside, Square(kBesidePoint));
  DropSmallRegions(&shown);
  const cv::Mat gaps = Enclosed(shown) | Enclosed(shown | around);
  shown |= gaps & background.same;
  // What is left has the background's colour.
  cv::Mat uncertain = ((gaps | beside) & ~shown) | contradicted, inner, outer;
  // Nor can anything be told where no colour is known to be the background's.
  uncertain |= ~background.known & ~among;
  cv::erode(shown, inner, Square(kEdge));
  cv::dilate(shown, outer, Square(kEdge));
  uncertain |= outer & ~inner;
  return {MaskOf(shown), MaskOf(~uncertain)};
}

// The pixel of a mask that covers most of pixel (x, y) of a picture.
std::size_t CoveringPixel(const io::Mask& mask, const io::Image& picture, int x, int y) {
  const auto scaled = [](int at, int from, int to) {
    return static_cast<int>((2 * std::int64_t{at} + 1) * to / (2 * std::int64_t{from}));
  };
  return static_cast<std::size_t>(scaled(y, picture.height, mask.height)) *
             static_cast<std::size_t>(mask.width) +
         static_cast<std::size_t>(scaled(x, picture.width, mask.width));
}

}  // namespace

double MovingSubject::Share() const {
  std::size_t n = 0;
  for (std::size_t i = 0; i < shown.used.size(); ++i) n += shown.Uses(i) && certain.Uses(i);
  return static_cast<double>(n) / static_cast<double>(shown.used.size());
}

std::vector<MovingSubject> SubjectsOnTurntable(const io::Scene& scene, int threads) {
  const std::size_t n = scene.frames.size();
  if (n == 0) return {};
  std::vector<cv::Mat> small(n);
  std::vector<cv::Size> sizes(n);
  io::ParallelFor(
      n, threads, [&](std::size_t i) { small[i] = ReadSmall(scene.frames[i].image_path, &sizes[i]); });
  if (std::any_of(sizes.begin(), sizes.end(), [&](const cv::Size& size) { return size != sizes[0]; }))
    return {};
  Background background = FindBackground(small, threads);
  std::vector<cv::Mat> points(n), among(n);
  io::ParallelFor(n, threads, [&](std::size_t i) {
    points[i] = SubjectPoints(scene, static_cast<int>(i), small[i].size());
    among[i] = AmongPoints(points[i]);
  });
  ForgetSubject(small, among, &background);
  std::vector<MovingSubject> subjects(n);
  io::ParallelFor(
      n, threads, [&](std::size_t i) { subjects[i] = Subject(small[i], points[i], among[i], background); });
  const bool is_any = std::all_of(subjects.begin(), subjects.end(), [](const MovingSubject& subject) {
    const double share = subject.Share();
    return share >= kMinMovingShare && share <= kMaxMovingShare;
  });
  return is_any ? subjects : std::vector<MovingSubject>();
}

CutPicture CutOut(const io::Image& picture, const io::Mask& used, const MovingSubject& subject) {
  CutPicture cut{io::MakeImage(picture.width, picture.height, 4),
                 {picture.width, picture.height, std::vector<std::uint8_t>()}};
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const std::size_t small = CoveringPixel(subject.shown, picture, x, y);
      std::copy_n(picture.Pixel(x, y), 3, cut.image.Pixel(x, y));
      cut.image.Pixel(x, y)[3] = subject.shown.used[small];
      const auto pixel =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(x);
      cut.certain.used.push_back(used.Uses(pixel) ? subject.certain.used[small] : 0);
    }
  }
  return cut;
}

}  // namespace sfm
