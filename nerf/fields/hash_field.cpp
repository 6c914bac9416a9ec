#include "nerf/fields/hash_field.h"

#include <algorithm>

#include "io/base/check.h"

namespace nerf {
namespace {

// Samples that are queried together: their activations stay in a 1 MB second-level cache, and each table is
// looked up often enough in a row to stay there as well.
constexpr int kQueryRows = 512;

HashField::Network MakeNetwork(bool bf16, std::uint64_t seed) {
  if (bf16) return HashNetwork<kernels::Bf16>(seed);
  return HashNetwork<float>(seed);
}

// Sets the features of hashed levels, but never of the coarsest, to 0 for samples [first, first + n) that lie
// in untrained cells.
template <typename Real>
void DropUntrained(const HashGrid& grid,
                   const TrainedCells& trained,
                   const Samples& samples,
                   int first,
                   int n,
                   Real* features) {
  if (trained.ContainsAll()) return;
  const auto hashed = std::find_if(grid.levels().begin(),
                                   grid.levels().end(),
                                   [](const kernels::GridLevel& l) { return l.hash_mask != 0; });
  const std::size_t n_levels =
      std::max<std::size_t>(1, static_cast<std::size_t>(hashed - grid.levels().begin()));
  const std::size_t n_kept = n_levels * kernels::kFeatures;
  const auto n_features = static_cast<std::size_t>(grid.n_features());
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
    const std::size_t s = static_cast<std::size_t>(first) + i;
    if (trained.Contains(samples.x[s], samples.y[s], samples.z[s])) continue;
    std::fill(features + i * n_features + n_kept, features + (i + 1) * n_features, Real{});
  }
}

// Calls body(first, rows) with the densities of kQueryRows samples at a time.
template <typename Real, typename Body>
void QueryDensities(const HashGrid& grid,
                    const TrainedCells& trained,
                    const HashNetwork<Real>& network,
                    const Samples& samples,
                    const Body& body) {
  thread_local NetworkRows<Real> rows;
  for (int first = 0; first < samples.size(); first += kQueryRows) {
    rows.Resize(std::min(kQueryRows, samples.size() - first));
    grid.Encode(samples, first, rows.n, rows.features.data());
    DropUntrained(grid, trained, samples, first, rows.n, rows.features.data());
    network.QueryDensity(&rows);
    body(first, &rows);
  }
}

// Colours of the wanted rows; `rows` keeps those alone.
template <typename Real>
void QueryColours(const HashNetwork<Real>& network,
                  std::span<const Ray> rays,
                  std::span<const int> ray_of,  // of the rows
                  const std::uint8_t* wanted,
                  NetworkRows<Real>* rows,
                  float* rgb) {
  int place[kQueryRows], n_wanted = 0;
  for (int i = 0; i < rows->n; ++i) {
    if (!wanted[i]) continue;
    constexpr int kOut = HashNetwork<Real>::kOutputs;
    std::copy_n(&rows->out[static_cast<std::size_t>(i * kOut)],
                kOut,
                &rows->out[static_cast<std::size_t>(n_wanted * kOut)]);
    place[n_wanted++] = i;
  }
  rows->n = n_wanted;
  const auto ray_at = [&](int i) {
    return static_cast<std::size_t>(ray_of[static_cast<std::size_t>(place[i])]);
  };
  for (int begin = 0, end; begin < rows->n; begin = end) {
    for (end = begin + 1; end < rows->n && ray_at(end) == ray_at(begin);) ++end;
    network.SetDirection(rays[ray_at(begin)].direction, begin, end, rows);
  }
  network.QueryColour(rows);
  for (int i = 0; i < rows->n; ++i)
    std::copy_n(&rows->rgb[3 * static_cast<std::size_t>(i)], 3, rgb + 3 * place[i]);
}

}  // namespace

HashField::HashField(const HashFieldOptions& options, std::uint64_t seed)
    : grid_(options.grid, seed), network_(MakeNetwork(options.bf16_network, seed)) {
  PIPELINE_CHECK_EQ(grid_.n_features(), HashNetwork<float>::kInputs);
}

void HashField::Refresh() {
  grid_.Refresh();
  trained_cells_.Refresh();
  std::visit([](auto& network) { network.Refresh(); }, network_);
}

std::size_t HashField::n_parameters() const {
  return grid_.n_parameters() + std::visit([](const auto& network) { return network.n_weights(); }, network_);
}

void HashField::QueryDensity(const Samples& samples, float* sigma) const {
  const auto query = [&](const auto& network) {
    QueryDensities(grid_, trained_cells_, network, samples, [&](int first, const auto* rows) {
      std::copy_n(rows->sigma.begin(), rows->n, sigma + first);
    });
  };
  std::visit(query, network_);
}

void HashField::Query(const Samples& samples,
                      std::span<const Ray> rays,
                      std::span<const int> ray_of,
                      int /*pass*/,
                      const ColourFilter& filter,
                      float* sigma,
                      float* rgb) const {
  const auto query = [&](const auto& network) {
    QueryDensities(grid_, trained_cells_, network, samples, [&](int first, auto* rows) {
      std::copy_n(rows->sigma.begin(), rows->n, sigma + first);
      std::uint8_t wanted[kQueryRows];
      filter(first, rows->n, sigma + first, wanted);
      const auto at = static_cast<std::size_t>(first);
      QueryColours(network, rays, ray_of.subspan(at), wanted, rows, rgb + 3 * at);
    });
  };
  std::visit(query, network_);
}

FieldConfig HashField::Config() const {
  const HashGridOptions& grid = grid_.options();
  return {{"n_levels", grid.n_levels},
          {"log2_hashmap_size", grid.log2_hashmap_size},
          {"base_resolution", grid.base_resolution},
          {"finest_resolution", grid.finest_resolution},
          {"bf16_table", grid.bf16},
          {"entry_moments", grid.entry_moments},
          {"bf16_network", network_.index() == 1}};
}

std::vector<Tensor> HashField::State() {
  std::vector<Tensor> state = grid_.State();
  for (Tensor& tensor : std::visit([](auto& network) { return network.State(); }, network_))
    state.push_back(std::move(tensor));
  return state;
}

}  // namespace nerf
