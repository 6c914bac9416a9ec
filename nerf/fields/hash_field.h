// The `hash` radiance field: a multi-resolution hash grid feeding two small networks (hash_grid.h,
// hash_network.h). Its precision is an option: the networks' products in float or bfloat16. Queries leave the
// hashed levels out where training did not touch them (trained_cells.h).
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "nerf/fields/hash_grid.h"
#include "nerf/fields/hash_network.h"
#include "nerf/fields/radiance_field.h"
#include "nerf/fields/trained_cells.h"

namespace nerf {

struct HashFieldOptions {
  HashGridOptions grid;
  bool bf16_network = false;
};

class HashField : public RadianceField {
 public:
  HashField(const HashFieldOptions& options, std::uint64_t seed);

  using Network = std::variant<HashNetwork<float>, HashNetwork<kernels::Bf16>>;
  HashGrid& grid() { return grid_; }
  const HashGrid& grid() const { return grid_; }
  Network& network() { return network_; }
  TrainedCells& trained_cells() { return trained_cells_; }

  FieldKind kind() const override { return FieldKind::kHash; }
  FieldConfig Config() const override;
  std::vector<Tensor> State() override;
  void Refresh() override;
  std::size_t n_parameters() const override;
  bool IsLearnt(float x, float y, float z) const override { return trained_cells_.IsNear(x, y, z); }
  void QueryDensity(const Samples& samples, float* sigma) const override;
  void Query(const Samples& samples,
             std::span<const Ray> rays,
             std::span<const int> ray_of,
             int pass,
             const ColourFilter& filter,
             float* sigma,
             float* rgb) const override;

 private:
  HashGrid grid_;
  Network network_;
  TrainedCells trained_cells_;
};

}  // namespace nerf
