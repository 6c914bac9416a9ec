#include "sfm/features/lens_curvature.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/calib3d.hpp>

#include "io/process/parallel.h"

namespace sfm {
namespace {

// Up to a circular fisheye of 180 degrees in a picture of 16:9, whose circle ends at half of the half
// diagonal. Steps are a tenth of the curvature's own size or finer, then halved around the best.
constexpr std::array<double, 13> kCurvatures = {
    0, -0.08, -0.15, -0.25, -0.35, -0.45, -0.6, -0.8, -1.05, -1.4, -1.9, -2.5, -3.3};
constexpr int kHalvings = 2;
// Of the matches, what a curved lens must explain over a pinhole camera. Captures of phones and cameras gain
// at most 5 % by any curvature; an action camera doubles what agrees.
constexpr double kMinGain = 1.06;
// Weaker curvature is left to the polynomial of bundle adjustment: 97 photos bent by 0.17 train as well, 29.9
// dB instead of 29.5.
constexpr double kMinCurvature = 0.2;
// Of a pair; of more, every second or so is enough.
constexpr std::size_t kMinPairMatches = 60, kMostPairMatches = 300;
constexpr std::size_t kMostPairs = 30, kMinPairs = 5;
// Of a match, in pixels of a picture whose longer side is 1600.
constexpr double kMaxLensErrorPx = 2;
// Pixels beyond this multiple of their radius, where the model stretches without end, count as outside.
constexpr double kMostStretch = 8;
constexpr int kMostLensSamples = 1000;
constexpr double kLensConfidence = 0.9999;

struct Placed {
  cv::Point2d at;        // pinhole camera, half diagonals
  cv::Matx22d jacobian;  // d at / d (position in the picture, half diagonals)
  bool inside = false;
};

Placed Place(const Keypoint& keypoint, double curvature, double width, double height) {
  const double half_diagonal = std::hypot(width, height) / 2;
  const cv::Point2d d((keypoint.x - width / 2) / half_diagonal, (keypoint.y - height / 2) / half_diagonal);
  const double stretch = 1 / (1 + curvature * d.dot(d));
  if (!(stretch > 0) || stretch > kMostStretch) return {};
  const double bend = -2 * curvature * stretch * stretch;
  return {d * stretch,
          {stretch + bend * d.x * d.x, bend * d.x * d.y, bend * d.x * d.y, stretch + bend * d.y * d.y},
          true};
}

cv::UsacParams LensUsac(double threshold) {
  cv::UsacParams params;
  params.threshold = threshold;
  params.confidence = kLensConfidence;
  params.maxIterations = kMostLensSamples;
  params.randomGeneratorState = 1;
  params.isParallel = false;
  params.sampler = cv::SAMPLING_UNIFORM;
  params.score = cv::SCORE_METHOD_MSAC;
  params.loMethod = cv::LOCAL_OPTIM_INNER_AND_ITER_LO;
  return params;
}

// Matches whose Sampson error, in the pictures as they are, is at most max_error.
int Agreeing(const std::vector<std::array<Placed, 2>>& placed, const cv::Matx33d& f, double max_error) {
  int n = 0;
  for (const auto& [a, b] : placed) {
    const cv::Vec3d in_a(a.at.x, a.at.y, 1), in_b(b.at.x, b.at.y, 1);
    const cv::Vec3d line_b = f * in_a, line_a = f.t() * in_b;
    const cv::Vec2d of_a = a.jacobian.t() * cv::Vec2d(line_a[0], line_a[1]);
    const cv::Vec2d of_b = b.jacobian.t() * cv::Vec2d(line_b[0], line_b[1]);
    const double error = in_b.dot(line_b);
    n += error * error <= max_error * max_error * (of_a.dot(of_a) + of_b.dot(of_b));
  }
  return n;
}

int AgreeingMatches(const std::vector<Features>& features,
                    const PairMatches& pair,
                    double curvature,
                    double width,
                    double height) {
  std::vector<std::array<Placed, 2>> placed;
  std::vector<cv::Point2d> a, b;
  for (const auto& [in_a, in_b] : pair.matches) {
    const std::array<Placed, 2> match = {
        Place(features[static_cast<std::size_t>(pair.a)].keypoints[static_cast<std::size_t>(in_a)],
              curvature,
              width,
              height),
        Place(features[static_cast<std::size_t>(pair.b)].keypoints[static_cast<std::size_t>(in_b)],
              curvature,
              width,
              height)};
    if (!match[0].inside || !match[1].inside) continue;
    placed.push_back(match);
    a.push_back(match[0].at), b.push_back(match[1].at);
  }
  if (placed.size() < kMinPairMatches / 2) return 0;
  const double max_error = kMaxLensErrorPx / 1600 * std::max(width, height) / (std::hypot(width, height) / 2);
  // What is stretched errs more.
  const cv::Mat f = cv::findFundamentalMat(a, b, cv::noArray(), LensUsac(1.5 * max_error));
  return f.rows == 3 ? Agreeing(placed, cv::Matx33d(f), max_error) : 0;
}

// At most `count` of them, evenly spread.
template <typename T>
std::vector<T> Spread(const std::vector<T>& all, std::size_t count) {
  if (all.size() <= count) return all;
  std::vector<T> spread;
  for (std::size_t i = 0; i < count; ++i) spread.push_back(all[i * all.size() / count]);
  return spread;
}

}  // namespace

double PinholeRadius(double curvature, double r) {
  const double stretch = 1 + curvature * r * r;
  return stretch > 0 ? r / stretch : std::numeric_limits<double>::infinity();
}

double LensRadius(double curvature, double r_pinhole) {
  return 2 * r_pinhole / (1 + std::sqrt(1 - 4 * curvature * r_pinhole * r_pinhole));
}

double FisheyeFocal(double curvature) { return std::sqrt(-0.36 / curvature); }

LensCurvature FindLensCurvature(const std::vector<Features>& features,
                                const std::vector<PairMatches>& pairs,
                                int width,
                                int height,
                                int threads) {
  std::vector<PairMatches> used;
  for (const PairMatches& pair : pairs) {
    if (pair.matches.size() >= kMinPairMatches) used.push_back(pair);
  }
  if (used.size() < kMinPairs) return {};
  used = Spread(used, kMostPairs);  // near pairs as well as distant ones
  double n_matches = 0;
  for (PairMatches& pair : used) {
    pair.matches = Spread(pair.matches, kMostPairMatches);
    n_matches += static_cast<double>(pair.matches.size());
  }
  const auto share = [&](double curvature) {
    std::vector<int> agreeing(used.size());
    io::ParallelFor(used.size(), threads, [&](std::size_t i) {
      agreeing[i] = AgreeingMatches(features, used[i], curvature, width, height);
    });
    return std::accumulate(agreeing.begin(), agreeing.end(), 0) / n_matches;
  };
  std::array<double, kCurvatures.size()> shares;
  std::transform(kCurvatures.begin(), kCurvatures.end(), shares.begin(), share);
  const auto best = static_cast<std::size_t>(std::max_element(shares.begin(), shares.end()) - shares.begin());
  LensCurvature found{kCurvatures[best], shares[best], shares[0]};
  if (found.agreeing < kMinGain * found.agreeing_pinhole || -found.curvature < kMinCurvature)
    return {0, found.agreeing, found.agreeing_pinhole};
  double step = (kCurvatures[best - 1] - kCurvatures[best]) / 2;
  for (int i = 0; i < kHalvings; ++i, step /= 2) {
    for (const double curvature : {found.curvature - step, found.curvature + step}) {
      const double agreeing = share(curvature);
      if (agreeing > found.agreeing) found.curvature = curvature, found.agreeing = agreeing;
    }
  }
  return found;
}

}  // namespace sfm
