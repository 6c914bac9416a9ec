#include "sfm/image_pairs.h"

#include <algorithm>
#include <atomic>
#include <thread>

#include "io/interrupt.h"

namespace sfm {
namespace {

constexpr float kMaxSquaredRatio = 0.8f * 0.8f;  // Lowe's ratio, on squared distances
constexpr int kMinShared = 4;                    // Wu's threshold: fewer are chance

struct Neighbour {
  int index = -1;
  bool distinct = false;
};

// Nearest column of each row of a similarity matrix, and whether it is clearly nearer than the second.
std::vector<Neighbour> NearestColumns(const Descriptors& similarity) {
  std::vector<Neighbour> nearest(static_cast<std::size_t>(similarity.rows()));
  for (Eigen::Index r = 0; r < similarity.rows(); ++r) {
    float best = -1, second = -1;
    for (Eigen::Index c = 0; c < similarity.cols(); ++c) {
      const float s = similarity(r, c);
      if (s > best) {
        second = best;
        best = s;
        nearest[static_cast<std::size_t>(r)].index = static_cast<int>(c);
      } else if (s > second) {
        second = s;
      }
    }
    // Squared distance of unit vectors: 2 - 2 s.
    nearest[static_cast<std::size_t>(r)].distinct = 1 - best < kMaxSquaredRatio * (1 - second);
  }
  return nearest;
}

int CountShared(const Descriptors& a, const Descriptors& b) {
  if (a.rows() == 0 || b.rows() == 0) return 0;
  const Descriptors similarity = a * b.transpose();
  const std::vector<Neighbour> from_a = NearestColumns(similarity),
                               from_b = NearestColumns(similarity.transpose());
  int shared = 0;
  for (std::size_t i = 0; i < from_a.size(); ++i) {
    shared +=
        from_a[i].distinct && from_b[static_cast<std::size_t>(from_a[i].index)].index == static_cast<int>(i);
  }
  return shared;
}

}  // namespace

ImagePairs AllPairs(int n) { return SequentialPairs(n, n); }

ImagePairs SequentialPairs(int n, int overlap) {
  ImagePairs pairs;
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n && j <= i + overlap; ++j) pairs.emplace(i, j);
  }
  return pairs;
}

ImagePairs LikelyPairs(const std::vector<Descriptors>& pictures, int partners, int threads) {
  const int n = static_cast<int>(pictures.size());
  Eigen::MatrixXi shared = Eigen::MatrixXi::Zero(n, n);
  std::atomic<int> next_row = 0;
  std::vector<std::jthread> workers;
  for (int t = 0; t < threads; ++t) {
    workers.emplace_back([&] {
      for (int i = next_row++; i < n && io::PendingInterrupt() == 0; i = next_row++) {
        for (int j = i + 1; j < n; ++j) {
          shared(i, j) = shared(j, i) =
              CountShared(pictures[static_cast<std::size_t>(i)], pictures[static_cast<std::size_t>(j)]);
        }
      }
    });
  }
  workers.clear();
  io::ThrowIfInterrupted();

  ImagePairs pairs;
  for (int i = 0; i < n; ++i) {
    std::vector<int> order;
    for (int j = 0; j < n; ++j) {
      if (shared(i, j) >= kMinShared) order.push_back(j);
    }
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return shared(i, a) > shared(i, b); });
    order.resize(std::min<std::size_t>(order.size(), static_cast<std::size_t>(partners)));
    for (const int j : order) pairs.emplace(std::min(i, j), std::max(i, j));
  }
  return pairs;
}

}  // namespace sfm
