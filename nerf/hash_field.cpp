#include "nerf/hash_field.h"

#include <algorithm>

#include "io/check.h"

namespace nerf {
namespace {

// Samples that are queried together: their activations stay in a 1 MB second-level cache, and each table is
// looked up often enough in a row to stay there as well.
constexpr int kQueryRows = 512;

HashField::Network MakeNetwork(bool bf16, std::uint64_t seed) {
  if (bf16) return HashNetwork<kernels::Bf16>(seed);
  return HashNetwork<float>(seed);
}

template <typename Real>
void Query(const HashGrid& grid,
           const HashNetwork<Real>& network,
           const Samples& samples,
           std::span<const Ray> rays,
           std::span<const int> ray_of,
           float* sigma,
           float* rgb) {
  thread_local NetworkRows<Real> rows;
  for (int first = 0; first < samples.size(); first += kQueryRows) {
    rows.Resize(std::min(kQueryRows, samples.size() - first));
    grid.Encode(samples, first, rows.n, rows.features.data());
    network.QueryDensity(&rows);
    const auto ray_at = [&](int i) { return ray_of[static_cast<std::size_t>(first + i)]; };
    for (int begin = 0, end; begin < rows.n; begin = end) {
      for (end = begin + 1; end < rows.n && ray_at(end) == ray_at(begin);) ++end;
      network.SetDirection(rays[static_cast<std::size_t>(ray_at(begin))].direction, begin, end, &rows);
    }
    network.QueryColour(&rows);
    std::copy_n(rows.sigma.begin(), rows.n, sigma + first);
    std::copy_n(rows.rgb.begin(), 3 * rows.n, rgb + 3 * static_cast<std::ptrdiff_t>(first));
  }
}

template <typename Real>
void QueryDensity(const HashGrid& grid,
                  const HashNetwork<Real>& network,
                  const Samples& samples,
                  float* sigma) {
  thread_local NetworkRows<Real> rows;
  for (int first = 0; first < samples.size(); first += kQueryRows) {
    rows.Resize(std::min(kQueryRows, samples.size() - first));
    grid.Encode(samples, first, rows.n, rows.features.data());
    network.QueryDensity(&rows);
    std::copy_n(rows.sigma.begin(), rows.n, sigma + first);
  }
}

}  // namespace

HashField::HashField(const HashFieldOptions& options, std::uint64_t seed)
    : grid_(options.grid, seed), network_(MakeNetwork(options.bf16_network, seed)) {
  PIPELINE_CHECK_EQ(grid_.n_features(), HashNetwork<float>::kInputs);
}

void HashField::Refresh() {
  grid_.Refresh();
  std::visit([](auto& network) { network.Refresh(); }, network_);
}

std::size_t HashField::n_parameters() const {
  return grid_.n_parameters() + std::visit([](const auto& network) { return network.n_weights(); }, network_);
}

void HashField::QueryDensity(const Samples& samples, float* sigma) const {
  std::visit([&](const auto& network) { nerf::QueryDensity(grid_, network, samples, sigma); }, network_);
}

void HashField::Query(const Samples& samples,
                      std::span<const Ray> rays,
                      std::span<const int> ray_of,
                      int /*pass*/,
                      float* sigma,
                      float* rgb) const {
  std::visit([&](const auto& network) { nerf::Query(grid_, network, samples, rays, ray_of, sigma, rgb); },
             network_);
}

FieldConfig HashField::Config() const {
  const HashGridOptions& grid = grid_.options();
  return {{"n_levels", grid.n_levels},
          {"log2_hashmap_size", grid.log2_hashmap_size},
          {"base_resolution", grid.base_resolution},
          {"finest_resolution", grid.finest_resolution},
          {"bf16_table", grid.bf16},
          {"bf16_network", network_.index() == 1}};
}

std::vector<Tensor> HashField::State() {
  std::vector<Tensor> state = grid_.State();
  for (Tensor& tensor : std::visit([](auto& network) { return network.State(); }, network_))
    state.push_back(std::move(tensor));
  return state;
}

}  // namespace nerf
