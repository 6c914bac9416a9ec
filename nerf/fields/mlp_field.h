// The `nerf` field: the network of the original NeRF on positional codes, with the options that decide how
// well it trains. Its arithmetic is that of the Mlp behind it; everything else is shared with `hash`.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "nerf/fields/density_activation.h"
#include "nerf/fields/mlp.h"
#include "nerf/fields/positional_encoding.h"
#include "nerf/fields/radiance_field.h"

namespace nerf {

// The defaults train best; ReportTrainOptions() has the report's values.
struct MlpFieldOptions {
  EncodingOptions position = {.frequencies = 10};
  EncodingOptions direction = {.frequencies = 4, .times_pi = false};
  // Positions are encoded in scene units; else in those of the scene's cube, which fills [-1, 1]. Contracted
  // space around it then fills [-2, 2].
  bool scene_units = false;
  DensityActivation density = DensityActivation::kSoftplus;
  Initialisation initialisation = Initialisation::kXavier;
  bool pixel_centres = true;  // rays through (x + 0.5, y + 0.5); else, as the original code, through (x, y)
  QuadratureOptions quadrature;
  bool bf16 = false;
  std::string device = "cpu";
};

MlpOptions MlpOptionsOf(const MlpFieldOptions& options);

class MlpField : public RadianceField {
 public:
  MlpField(const MlpFieldOptions& options, bool contracted, std::uint64_t seed);
  // From a checkpoint's values. Throws kBadState for values out of range.
  explicit MlpField(const FieldConfig& config);

  FieldKind kind() const override { return FieldKind::kMlp; }
  FieldConfig Config() const override;
  std::vector<Tensor> State() override;
  void Refresh() override;
  std::size_t n_parameters() const override { return weights_.size(); }
  QuadratureOptions quadrature() const override { return options_.quadrature; }
  double pixel_offset() const override { return options_.pixel_centres ? 0.5 : 0.0; }
  void QueryDensity(const Samples& samples, float* sigma) const override;
  void Query(const Samples& samples,
             std::span<const Ray> rays,
             std::span<const int> ray_of,
             int pass,
             const ColourFilter& filter,
             float* sigma,
             float* rgb) const override;

  const MlpFieldOptions& options() const { return options_; }
  const Mlp& network(int pass) const { return *networks_[static_cast<std::size_t>(pass)]; }
  int n_networks() const { return static_cast<int>(networks_.size()); }
  std::size_t weights_per_network() const { return weights_.size() / networks_.size(); }

  // Codes of samples [first, first + n), in rows of CodeStride.
  void EncodePositions(const Samples& samples, int first, int n, std::vector<float>* codes) const;
  // Code of one direction, padded with zeros to CodeStride.
  void EncodeDirection(const float direction[3], float* code) const;

  // Adam on all weights. Gradients are cleared.
  void Step(double learning_rate, std::uint64_t step, float* gradients);

 private:
  void Build();

  MlpFieldOptions options_;
  bool contracted_ = false;
  MlpOptions mlp_;
  std::vector<std::unique_ptr<Mlp>> networks_;          // one, or coarse and fine
  std::vector<float> weights_, weights_m_, weights_v_;  // of all networks, in this order
};

}  // namespace nerf
