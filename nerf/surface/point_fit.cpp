#include "nerf/surface/point_fit.h"

#include <algorithm>
#include <cmath>
#include <opencv2/flann.hpp>
#include <vector>

#include "io/base/median.h"
#include "io/process/interrupt.h"

namespace nerf {
namespace {

using Eigen::Vector3f;

constexpr std::size_t kLeastFrames = 2;  // that observe a point, where they are known
constexpr int kNeighbours = 32;
constexpr float kFacingAlike = 0.5f;  // cosine between two normals
constexpr int kPerTask = 4096;

cv::Mat RowsOf(const std::vector<Vector3f>& points, std::size_t first, std::size_t n) {
  return {static_cast<int>(n), 3, CV_32F, const_cast<float*>(points[first].data())};
}

// Calls use(i, indices, squared distances) with the k nearest of `points` to each query, nearest first.
template <typename Use>
void ForNearest(const std::vector<Vector3f>& points,
                const std::vector<Vector3f>& queries,
                int k,
                io::Workers* workers,
                const Use& use) {
  cv::flann::GenericIndex<cvflann::L2_Simple<float>> tree(RowsOf(points, 0, points.size()),
                                                          cvflann::KDTreeSingleIndexParams());
  const int n_tasks = (static_cast<int>(queries.size()) + kPerTask - 1) / kPerTask;
  workers->Run(n_tasks, [&](int task, int) {
    io::ThrowIfInterrupted();
    const std::size_t first = static_cast<std::size_t>(task) * kPerTask;
    const cv::Mat batch = RowsOf(queries, first, std::min<std::size_t>(kPerTask, queries.size() - first));
    cv::Mat indices(batch.rows, k, CV_32S), squares(batch.rows, k, CV_32F);
    tree.knnSearch(batch, indices, squares, k, cvflann::SearchParams());
    for (int row = 0; row < batch.rows; ++row)
      use(first + static_cast<std::size_t>(row), indices.ptr<int>(row), squares.ptr<float>(row));
  });
}

// Points near the mesh.
struct Anchors {
  std::vector<Vector3f> points, normals;  // normals: of the mesh there
  std::vector<float> offsets;             // along these, before the mesh
};

Anchors AnchorsOf(const std::vector<io::Point3D>& points,
                  double reach,
                  const io::Mesh& mesh,
                  io::Workers* workers) {
  std::vector<Vector3f> wanted;
  for (const io::Point3D& point : points) {
    if (point.frame_indices.empty() || point.frame_indices.size() >= kLeastFrames)
      wanted.push_back(point.xyz.cast<float>());
  }
  constexpr int kNone = -1;
  std::vector<int> nearest(wanted.size(), kNone);
  if (!wanted.empty() && !mesh.positions.empty()) {
    const auto most = static_cast<float>(reach * reach);
    ForNearest(mesh.positions, wanted, 1, workers, [&](std::size_t i, const int* index, const float* square) {
      if (*square <= most) nearest[i] = *index;
    });
  }
  Anchors anchors;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (nearest[i] == kNone) continue;
    const auto vertex = static_cast<std::size_t>(nearest[i]);
    anchors.points.push_back(wanted[i]);
    anchors.normals.push_back(mesh.normals[vertex]);
    anchors.offsets.push_back(mesh.normals[vertex].dot(wanted[i] - mesh.positions[vertex]));
  }
  return anchors;
}

}  // namespace

PointFit FitToPoints(const std::vector<io::Point3D>& points,
                     double footprint,
                     io::Workers* workers,
                     io::Mesh* mesh) {
  const Anchors anchors = AnchorsOf(points, kNearFootprints * footprint, *mesh, workers);
  if (anchors.points.empty()) return {};
  const auto reach_squared = static_cast<float>(std::pow(kFitFootprints * footprint, 2));
  const int k = std::min(kNeighbours, static_cast<int>(anchors.points.size()));
  std::vector<float> shifts(mesh->positions.size());
  ForNearest(anchors.points,
             mesh->positions,
             k,
             workers,
             [&](std::size_t vertex, const int* indices, const float* squares) {
               float sum = 0, weights = static_cast<float>(kPriorWeight);
               for (int i = 0; i < k && squares[i] < reach_squared; ++i) {
                 const auto anchor = static_cast<std::size_t>(indices[i]);
                 if (anchors.normals[anchor].dot(mesh->normals[vertex]) < kFacingAlike) continue;
                 const float weight = std::pow(1 - squares[i] / reach_squared, 2.f);
                 sum += weight * anchors.offsets[anchor];
                 weights += weight;
               }
               shifts[vertex] = sum / weights;
             });
  for (std::size_t i = 0; i < shifts.size(); ++i) mesh->positions[i] += shifts[i] * mesh->normals[i];
  return {.points = anchors.points.size(),
          .median_offset = io::Median(std::vector<double>(anchors.offsets.begin(), anchors.offsets.end()))};
}

}  // namespace nerf
