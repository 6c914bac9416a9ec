#include "sfm/mapping/capture_blocks.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace sfm {
namespace {

// Of the pictures of a part that either side gets at least.
constexpr double kLeastShare = 1.0 / 3;
// Power iterations for the eigenvector. Neighbouring pictures agree after a few; only where the cut lies
// depends on the rest, and any cut will do that separates few matches.
constexpr int kIterations = 1000;
// In place of the links of a picture that has none in its part; far below one match.
constexpr double kNoLinks = 1e-12;

struct Neighbour {
  int picture;
  double weight;
};
using Graph = std::vector<std::vector<Neighbour>>;
using Part = std::vector<int>;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

Graph MakeGraph(int n, const std::vector<PictureLink>& links) {
  Graph graph(Index(n));
  for (const PictureLink& link : links) {
    graph[Index(link.a)].push_back({link.b, link.weight});
    graph[Index(link.b)].push_back({link.a, link.weight});
  }
  return graph;
}

std::vector<Part> Components(const Graph& graph) {
  std::vector<Part> components;
  std::vector<bool> seen(graph.size(), false);
  for (std::size_t i = 0; i < graph.size(); ++i) {
    if (seen[i] || graph[i].empty()) continue;
    Part part = {static_cast<int>(i)};
    seen[i] = true;
    for (std::size_t k = 0; k < part.size(); ++k) {
      for (const Neighbour& neighbour : graph[Index(part[k])]) {
        if (!seen[Index(neighbour.picture)]) part.push_back(neighbour.picture);
        seen[Index(neighbour.picture)] = true;
      }
    }
    std::sort(part.begin(), part.end());
    components.push_back(std::move(part));
  }
  return components;
}

// The graph of a part alone, its pictures numbered from 0.
Graph Restricted(const Graph& graph, const Part& part) {
  std::vector<int> position(graph.size(), -1);
  for (std::size_t i = 0; i < part.size(); ++i) position[Index(part[i])] = static_cast<int>(i);
  Graph restricted(part.size());
  for (std::size_t i = 0; i < part.size(); ++i) {
    for (const Neighbour& neighbour : graph[Index(part[i])]) {
      const int other = position[Index(neighbour.picture)];
      if (other >= 0) restricted[i].push_back({other, neighbour.weight});
    }
  }
  return restricted;
}

Eigen::VectorXd Degrees(const Graph& graph) {
  Eigen::VectorXd degrees(static_cast<Eigen::Index>(graph.size()));
  for (std::size_t i = 0; i < graph.size(); ++i) {
    degrees[static_cast<Eigen::Index>(i)] = std::accumulate(
        graph[i].begin(), graph[i].end(), 0.0, [](double sum, const Neighbour& n) { return sum + n.weight; });
  }
  return degrees.cwiseMax(kNoLinks);
}

// Second eigenvector of D^-1/2 W D^-1/2, times D^-1/2: where pictures lie along the longest extent of the
// graph. Begins from their order, which mostly is that of a walk.
Eigen::VectorXd Positions(const Graph& graph, const Eigen::VectorXd& degrees) {
  const Eigen::Index n = degrees.size();
  const Eigen::VectorXd root = degrees.cwiseSqrt();
  const Eigen::VectorXd first = root.normalized();
  Eigen::VectorXd v = Eigen::VectorXd::LinSpaced(n, -1, 1).cwiseProduct(root);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    v -= first.dot(v) * first;
    const double norm = v.norm();
    if (!(norm > 0)) break;
    v /= norm;
    const Eigen::VectorXd scaled = v.cwiseQuotient(root);
    Eigen::VectorXd next = v;  // half the identity makes all eigenvalues positive
    for (Eigen::Index i = 0; i < n; ++i) {
      double sum = 0;
      for (const Neighbour& neighbour : graph[static_cast<std::size_t>(i)])
        sum += neighbour.weight * scaled[neighbour.picture];
      next[i] += sum / root[i];
    }
    v = next / 2;
  }
  return v.cwiseQuotient(root);
}

// The two sides of the cut along `positions` whose links are fewest for the links of either side.
std::pair<Part, Part> Cut(const Graph& graph, const Part& part) {
  const Eigen::VectorXd degrees = Degrees(graph), positions = Positions(graph, degrees);
  std::vector<int> order(part.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return positions[a] < positions[b]; });
  const double all = degrees.sum();
  const auto least = static_cast<std::size_t>(kLeastShare * static_cast<double>(part.size()));
  std::vector<bool> left(part.size(), false);
  double cut = 0, left_degree = 0, best = 0;
  std::size_t best_size = 0;
  for (std::size_t k = 0; k + least < part.size(); ++k) {
    const int picture = order[k];
    for (const Neighbour& neighbour : graph[Index(picture)])
      cut += left[Index(neighbour.picture)] ? -neighbour.weight : neighbour.weight;
    left[Index(picture)] = true;
    left_degree += degrees[picture];
    const double normalised = cut / left_degree + cut / std::max(kNoLinks, all - left_degree);
    if (k + 1 >= least && (best_size == 0 || normalised < best)) best = normalised, best_size = k + 1;
  }
  std::pair<Part, Part> sides;
  for (std::size_t k = 0; k < part.size(); ++k)
    (k < best_size ? sides.first : sides.second).push_back(part[Index(order[k])]);
  std::sort(sides.first.begin(), sides.first.end());
  std::sort(sides.second.begin(), sides.second.end());
  return sides;
}

void CutUntilSmall(const Graph& graph, const Part& part, int pictures, std::vector<Part>* parts) {
  if (static_cast<int>(part.size()) <= pictures) {
    parts->push_back(part);
    return;
  }
  const auto [left, right] = Cut(Restricted(graph, part), part);
  CutUntilSmall(graph, left, pictures, parts);
  CutUntilSmall(graph, right, pictures, parts);
}

Part WithNeighbours(const Graph& graph, Part part, double overlap) {
  std::vector<double> weight(graph.size(), 0);
  for (const int picture : part) {
    for (const Neighbour& neighbour : graph[Index(picture)])
      weight[Index(neighbour.picture)] += neighbour.weight;
  }
  for (const int picture : part) weight[Index(picture)] = 0;
  std::vector<int> others;
  for (std::size_t i = 0; i < weight.size(); ++i) {
    if (weight[i] > 0) others.push_back(static_cast<int>(i));
  }
  std::stable_sort(
      others.begin(), others.end(), [&](int a, int b) { return weight[Index(a)] > weight[Index(b)]; });
  const auto wanted = static_cast<std::size_t>(std::ceil(overlap * static_cast<double>(part.size())));
  others.resize(std::min(others.size(), wanted));
  part.insert(part.end(), others.begin(), others.end());
  std::sort(part.begin(), part.end());
  return part;
}

}  // namespace

std::vector<std::vector<int>> OverlappingBlocks(int n,
                                                const std::vector<PictureLink>& links,
                                                const BlockOptions& options) {
  const Graph graph = MakeGraph(n, links);
  std::vector<Part> parts;
  for (const Part& component : Components(graph)) CutUntilSmall(graph, component, options.pictures, &parts);
  for (Part& part : parts) part = WithNeighbours(graph, std::move(part), options.overlap);
  return parts;
}

}  // namespace sfm
