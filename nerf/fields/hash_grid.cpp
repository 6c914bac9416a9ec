#include "nerf/fields/hash_grid.h"

#include <algorithm>
#include <cmath>

#include "io/base/random.h"

namespace nerf {
namespace {

// Table entries start as tiny noise, so that the coarse levels dominate the first steps [instant-ngp].
constexpr float kTableInit = 1e-4f;

}  // namespace

HashGrid::HashGrid(const HashGridOptions& options, std::uint64_t seed)
    : options_(options), kernels_(kernels::ActiveKernels()) {
  const double growth = std::pow(static_cast<double>(options.finest_resolution) / options.base_resolution,
                                 1.0 / (options.n_levels - 1));
  std::size_t n_entries = 0;
  for (int l = 0; l < options.n_levels; ++l) {
    kernels::GridLevel level;
    level.resolution = static_cast<std::uint32_t>(std::lround(options.base_resolution * std::pow(growth, l)));
    const std::size_t hashed = std::size_t{1} << options.log2_hashmap_size, side = level.resolution + 1;
    const bool dense = side * side * side <= hashed;
    level.n_entries = dense ? (side * side * side + 3) / 4 * 4 : hashed;  // whole 64-byte lines
    level.hash_mask = dense ? 0 : static_cast<std::uint32_t>(hashed - 1);
    level.first_entry = n_entries;
    n_entries += level.n_entries;
    levels_.push_back(level);
  }
  table_.resize(n_entries * kernels::kFeatures);
  for (std::size_t i = 0; i < table_.size(); ++i) {
    table_[i] = kTableInit * (2.f * io::Random(seed, io::Stream::kInit, 0, i).Uniform() - 1.f);
  }
  m_.assign(options.entry_moments ? 0 : table_.size(), 0.f);
  v_.assign(options.entry_moments ? n_entries : table_.size(), 0.f);
  if (options.bf16) rounded_.resize(table_.size());
  Refresh();
}

void HashGrid::Refresh() {
  if (!options_.bf16) return;
  kernels_.bf16.round(1, static_cast<int>(table_.size()), table_.data(), rounded_.data(), 0);
}

template <typename Real>
void HashGrid::Encode(const Samples& samples, int first, int n, Real* features) const {
  const kernels::NetworkKernels<Real>& kernels = kernels_.Network<Real>();
  const float *x = samples.x.data() + first, *y = samples.y.data() + first, *z = samples.z.data() + first;
  for (const kernels::GridLevel& level : levels_) {
    const std::size_t at = level.first_entry * kernels::kFeatures;
    if (options_.bf16) {
      kernels.encode_bf16(level, &rounded_[at], x, y, z, n, features, n_features());
    } else {
      kernels.encode(level, &table_[at], x, y, z, n, features, n_features());
    }
    features += kernels::kFeatures;
  }
}

template <typename Real>
void HashGrid::Scatter(
    int level, const Real* feature_gradients, const Samples& samples, int n, float* gradients) const {
  kernels_.Network<Real>().scatter(levels_[static_cast<std::size_t>(level)],
                                   feature_gradients,
                                   samples.x.data(),
                                   samples.y.data(),
                                   samples.z.data(),
                                   n,
                                   gradients);
}

template <typename Real>
void HashGrid::PositionGradient(int level,
                                const Real* feature_gradients,
                                const Samples& samples,
                                int n,
                                float* const gradients[3]) const {
  const kernels::NetworkKernels<Real>& kernels = kernels_.Network<Real>();
  const kernels::GridLevel& l = levels_[static_cast<std::size_t>(level)];
  const std::size_t at = l.first_entry * kernels::kFeatures;
  const float *x = samples.x.data(), *y = samples.y.data(), *z = samples.z.data();
  if (options_.bf16) {
    kernels.position_gradient_bf16(l, &rounded_[at], feature_gradients, x, y, z, n, gradients);
  } else {
    kernels.position_gradient(l, &table_[at], feature_gradients, x, y, z, n, gradients);
  }
}

void HashGrid::Step(int level, const kernels::AdamStep& step, float* gradients) {
  const kernels::GridLevel& l = levels_[static_cast<std::size_t>(level)];
  const std::size_t first = l.first_entry * kernels::kFeatures;
  kernels::Bf16* rounded = options_.bf16 ? &rounded_[first] : nullptr;
  if (options_.entry_moments) {
    kernels_.step_entries(step, l.n_entries, gradients, &v_[l.first_entry], &table_[first], rounded);
  } else {
    kernels_.adam(
        step, l.n_entries * kernels::kFeatures, gradients, &m_[first], &v_[first], &table_[first], rounded);
  }
}

std::size_t HashGrid::gradient_size() const {
  std::size_t size = 0;
  for (const kernels::GridLevel& level : levels_) size = std::max(size, level.n_entries * kernels::kFeatures);
  return size;
}

std::vector<Tensor> HashGrid::State() { return {{"table", table_}, {"table_m", m_}, {"table_v", v_}}; }

template void HashGrid::Encode(const Samples&, int, int, float*) const;
template void HashGrid::Encode(const Samples&, int, int, kernels::Bf16*) const;
template void HashGrid::Scatter(int, const float*, const Samples&, int, float*) const;
template void HashGrid::Scatter(int, const kernels::Bf16*, const Samples&, int, float*) const;
template void HashGrid::PositionGradient(int, const float*, const Samples&, int, float* const[3]) const;
template void HashGrid::PositionGradient(
    int, const kernels::Bf16*, const Samples&, int, float* const[3]) const;

}  // namespace nerf
