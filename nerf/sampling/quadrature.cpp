#include "nerf/sampling/quadrature.h"

#include <algorithm>
#include <cmath>

#include "io/base/check.h"

namespace nerf {

template <typename Scalar>
void AddImportanceSamples(Scalar near,
                          Scalar far,
                          const std::vector<Scalar>& weights,
                          int n,
                          io::Random* random,
                          std::vector<Scalar>* t) {
  PIPELINE_CHECK_EQ(weights.size(), t->size());
  const std::size_t n_bins = t->size();
  if (n_bins == 0) return;
  std::vector<Scalar> edges = {near};
  for (std::size_t i = 1; i < n_bins; ++i) edges.push_back(Scalar(0.5) * ((*t)[i - 1] + (*t)[i]));
  edges.push_back(far);
  std::vector<double> cumulative = {0};  // in double: weights of 1e-38 must still add up
  for (const Scalar weight : weights) {
    cumulative.push_back(cumulative.back() + static_cast<double>(std::max(weight, Scalar(0))));
  }
  const double total = cumulative.back();
  const bool even = !(total > 0) || !std::isfinite(total);
  std::size_t bin = 0;
  for (int i = 0; i < n; ++i) {
    const double u = (i + (random ? static_cast<double>(random->Uniform()) : 0.5)) / n;
    if (even) {
      t->push_back(near + static_cast<Scalar>(u) * (far - near));
      continue;
    }
    while (bin + 1 < n_bins && cumulative[bin + 1] <= u * total) ++bin;
    // Behind the last weight there may be bins without any: stay in the last one that has some.
    while (bin > 0 && cumulative[bin + 1] == cumulative[bin]) --bin;
    const double share = (u * total - cumulative[bin]) / (cumulative[bin + 1] - cumulative[bin]);
    const Scalar at = edges[bin] + static_cast<Scalar>(share) * (edges[bin + 1] - edges[bin]);
    t->push_back(std::clamp(at, edges[bin], edges[bin + 1]));
  }
  std::sort(t->begin(), t->end());
}

template void AddImportanceSamples<float>(
    float, float, const std::vector<float>&, int, io::Random*, std::vector<float>*);
template void AddImportanceSamples<double>(
    double, double, const std::vector<double>&, int, io::Random*, std::vector<double>*);

}  // namespace nerf
