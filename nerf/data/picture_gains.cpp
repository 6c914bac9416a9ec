#include "nerf/data/picture_gains.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

#include "io/base/median.h"

namespace nerf {
namespace {

using Eigen::Index;
using Eigen::MatrixX3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

// Observations that count: a point is looked up in the mean of the pixels around it, and none of these is
// overexposed or too dark for a ratio.
constexpr int kReach = 1, kLeastLevel = 12, kMostLevel = 249;
// All points together: more say nothing new about a few numbers per picture.
constexpr std::size_t kMostObservations = 200000;
// Colours of points and gains of pictures are medians by turns. What takes more turns to settle spans many
// pictures, and is smooth.
constexpr int kRounds = 5;
// Of a view whose gain can be told, and views that tell smooth from random.
constexpr std::size_t kLeastObservations = 20, kLeastViews = 8;
// Of views that are looked at together, in the order of the pictures: the cost grows with their cube.
constexpr std::size_t kMostTogether = 300;
// Length scales of s, in medians of the distances between cameras and between their directions; variances of
// e in those of s.
constexpr double kLengths[] = {0.125, 0.25, 0.5, 1};
constexpr double kNoises[] = {0.01, 0.03, 0.1, 0.3, 1, 3, 10, 100};
constexpr double kLeastDistance = 1e-6;  // of cameras that stand or look alike, against division by zero
// Standard deviations of e that are worth it: gains are told to about 1 %.
constexpr double kLeastSpread = 0.025;
constexpr double kMostGain = 4;  // two stops and more in sRGB levels: a larger one is a mistake of the points
// From this level on, what a gain does fades, so that white stays white.
constexpr double kShoulder = 250;

struct Observation {
  std::size_t point, view;
  Vector3d log_rgb;
};

std::optional<Vector3d> LogColour(const Dataset& dataset, const SparseDepth& depth) {
  const View& view = dataset.views[depth.view];
  const int x = static_cast<int>(depth.x), y = static_cast<int>(depth.y);
  if (x < kReach || y < kReach || x + kReach >= view.width || y + kReach >= view.height) return {};
  Vector3d sum = Vector3d::Zero();
  for (int v = y - kReach; v <= y + kReach; ++v) {
    for (int u = x - kReach; u <= x + kReach; ++u) {
      const std::uint8_t* rgb =
          &dataset.pixels[3 * (view.first_pixel + static_cast<std::size_t>(v * view.width + u))];
      if (std::max({rgb[0], rgb[1], rgb[2]}) > kMostLevel) return {};
      sum += Vector3d(rgb[0], rgb[1], rgb[2]);
    }
  }
  constexpr int kPixels = (2 * kReach + 1) * (2 * kReach + 1);
  if (sum.minCoeff() < kPixels * kLeastLevel) return {};
  return (sum / kPixels).array().log();
}

std::vector<Observation> Observations(const Dataset& dataset) {
  const std::size_t stride = 1 + dataset.depths.size() / kMostObservations;
  std::vector<Observation> observations;
  for (const SparseDepth& depth : dataset.depths) {
    if (depth.point % stride != 0) continue;
    if (const auto log_rgb = LogColour(dataset, depth))
      observations.push_back({depth.point, depth.view, *log_rgb});
  }
  return observations;
}

// Indices of the observations of each of n points or views.
std::vector<std::vector<std::size_t>> GroupsBy(const std::vector<Observation>& observations,
                                               std::size_t Observation::*key,
                                               std::size_t n) {
  std::vector<std::vector<std::size_t>> groups(n);
  for (std::size_t i = 0; i < observations.size(); ++i) groups[observations[i].*key].push_back(i);
  return groups;
}

// Medians, channel by channel, of value(observation).
template <typename Value>
Vector3d MedianOf(const std::vector<std::size_t>& group, const Value& value) {
  Vector3d median;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> values;
    for (const std::size_t i : group) values.push_back(value(i)[c]);
    median[c] = io::Median(std::move(values));
  }
  return median;
}

// g of each view; none where too few points are seen.
std::vector<std::optional<Vector3d>> LogGains(const Dataset& dataset) {
  const std::vector<Observation> observations = Observations(dataset);
  std::size_t n_points = 0;
  for (const Observation& observation : observations) n_points = std::max(n_points, observation.point + 1);
  const auto of_points = GroupsBy(observations, &Observation::point, n_points),
             of_views = GroupsBy(observations, &Observation::view, dataset.views.size());
  std::vector<Vector3d> colours(n_points, Vector3d::Zero()), gains(dataset.views.size(), Vector3d::Zero());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t point = 0; point < n_points; ++point) {
      if (of_points[point].empty()) continue;
      colours[point] = MedianOf(of_points[point], [&](std::size_t i) -> Vector3d {
        return observations[i].log_rgb - gains[observations[i].view];
      });
    }
    for (std::size_t view = 0; view < gains.size(); ++view) {
      if (of_views[view].size() < kLeastObservations) continue;
      gains[view] = MedianOf(of_views[view], [&](std::size_t i) -> Vector3d {
        return observations[i].log_rgb - colours[observations[i].point];
      });
    }
  }
  std::vector<std::optional<Vector3d>> told(gains.size());
  for (std::size_t view = 0; view < gains.size(); ++view)
    if (of_views[view].size() >= kLeastObservations) told[view] = gains[view];
  return told;
}

// The median of what lies above the diagonal.
double MedianAbove(const MatrixXd& distances) {
  std::vector<double> values;
  for (Index i = 0; i < distances.rows(); ++i)
    for (Index j = i + 1; j < distances.cols(); ++j) values.push_back(distances(i, j));
  return io::Median(std::move(values));
}

MatrixXd Distances(const MatrixX3d& places) {
  MatrixXd distances(places.rows(), places.rows());
  for (Index i = 0; i < places.rows(); ++i)
    distances.col(i) = (places.rowwise() - places.row(i)).rowwise().norm();
  return distances;
}

// e of each row of g; zero where it spreads too little.
MatrixX3d OwnPart(const MatrixX3d& places, const MatrixX3d& directions, const MatrixX3d& g) {
  const MatrixXd apart = Distances(places), turned = Distances(directions);
  const double distance = std::max(MedianAbove(apart), kLeastDistance),
               turn = std::max(MedianAbove(turned), kLeastDistance);
  const MatrixXd squares = (apart / distance).cwiseAbs2() + (turned / turn).cwiseAbs2();
  const MatrixX3d centred = g.rowwise() - g.colwise().mean();
  const Index n = g.rows();
  double most = -INFINITY, spread = 0;
  MatrixX3d own;
  for (const double length : kLengths) {
    const MatrixXd smooth = (squares / (-2 * length * length)).array().exp();
    for (const double noise : kNoises) {
      const Eigen::LLT<MatrixXd> covariance(smooth + noise * MatrixXd::Identity(n, n));
      const MatrixXd lower = covariance.matrixL();
      const MatrixX3d whitened = covariance.matrixL().solve(centred);
      const double variance = whitened.squaredNorm() / static_cast<double>(3 * n);
      if (!(variance > 0)) return MatrixX3d::Zero(n, 3);  // all pictures are alike
      const double likelihood =
          -1.5 * static_cast<double>(n) * std::log(variance) - 3 * lower.diagonal().array().log().sum();
      if (likelihood <= most) continue;
      most = likelihood, spread = std::sqrt(variance * noise);
      own = noise * covariance.matrixU().solve(whitened);
    }
  }
  return spread >= kLeastSpread ? own : MatrixX3d::Zero(n, 3);
}

}  // namespace

PictureGains FindPictureGains(const Dataset& dataset) {
  const std::vector<std::optional<Vector3d>> told = LogGains(dataset);
  std::vector<std::size_t> views;
  for (std::size_t view = 0; view < told.size(); ++view)
    if (told[view]) views.push_back(view);
  if (views.size() < kLeastViews) return {};
  PictureGains gains(told.size(), {1, 1, 1});
  bool is_any = false;
  const std::size_t n_groups = (views.size() + kMostTogether - 1) / kMostTogether;
  for (std::size_t group = 0; group < n_groups; ++group) {
    const std::size_t first = group * views.size() / n_groups, end = (group + 1) * views.size() / n_groups;
    MatrixX3d places(end - first, 3), directions(end - first, 3), g(end - first, 3);
    for (std::size_t i = first; i < end; ++i) {
      const View& view = dataset.views[views[i]];
      const auto row = static_cast<Index>(i - first);
      const Ray ray = view.camera.RayThrough(view.width / 2, view.height / 2);
      places.row(row) = Eigen::Vector3f(ray.origin).cast<double>();
      directions.row(row) = Eigen::Vector3f(ray.direction).normalized().cast<double>();
      g.row(row) = told[views[i]]->transpose();
    }
    const MatrixX3d own = OwnPart(places, directions, g);
    is_any = is_any || !own.isZero();
    for (std::size_t i = first; i < end; ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        gains[views[i]][c] = std::clamp(
            std::exp(own(static_cast<Index>(i - first), static_cast<Index>(c))), 1 / kMostGain, kMostGain);
    }
  }
  return is_any ? gains : PictureGains{};
}

double SpreadOf(const PictureGains& gains) {
  double squares = 0;
  for (const auto& gain : gains)
    for (const double channel : gain) squares += std::log(channel) * std::log(channel);
  return std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, 3 * gains.size())));
}

void EvenOut(const PictureGains& gains, Dataset* dataset) {
  for (std::size_t i = 0; i < gains.size(); ++i) {
    const View& view = dataset->views[i];
    for (std::size_t c = 0; c < 3; ++c) {
      const double gain = gains[i][c], knee = kShoulder * std::min(1.0, gain), at_knee = knee / gain;
      std::array<std::uint8_t, 256> even;
      for (int level = 0; level < 256; ++level) {
        const double value =
            level <= knee ? level / gain : at_knee + (255 - at_knee) * (level - knee) / (255 - knee);
        even[static_cast<std::size_t>(level)] = static_cast<std::uint8_t>(std::lround(value));
      }
      for (std::size_t pixel = view.first_pixel; pixel < view.first_pixel + view.n_pixels(); ++pixel) {
        std::uint8_t& value = dataset->pixels[3 * pixel + c];
        value = even[value];
      }
    }
  }
}

}  // namespace nerf
