#include "nerf/fields/mlp_field.h"

#include <cmath>
#include <cstring>

#include "io/base/check.h"
#include "io/base/error.h"

namespace nerf {
namespace {

// Adam as the report's: betas of the paper and the epsilon of PyTorch.
constexpr float kBeta1 = 0.9f, kBeta2 = 0.999f, kEpsilon = 1e-8f;
constexpr int kMaxFrequencies = 20;  // 2^20 exceeds what a float position resolves
constexpr int kMaxSamples = 1 << 14;

// Rows of codes, the network's inputs. Scratch of one thread, reused.
struct CodeRows {
  std::vector<float> position_codes, direction_codes, ray_codes;
};

template <typename T>
void Grow(std::vector<T>* v, std::size_t size) {
  if (v->size() < size) v->resize(size);
}

MlpFieldOptions OptionsFrom(const FieldConfig& config) {
  const auto get = [&](const char* key, double low, double high) {
    const auto it = config.find(key);
    if (it == config.end() || !(it->second >= low && it->second <= high)) {
      throw io::Error(io::ExitCode::kBadState,
                      std::string("checkpoint: value of ") + key + " is missing or out of range",
                      "Delete it and train again");
    }
    return it->second;
  };
  const auto flag = [&](const char* key) { return get(key, 0, 1) == 1; };
  MlpFieldOptions options;
  options.position = {static_cast<int>(get("position_frequencies", 0, kMaxFrequencies)),
                      flag("identity"),
                      flag("position_times_pi")};
  options.direction = {static_cast<int>(get("direction_frequencies", 0, kMaxFrequencies)),
                       flag("identity"),
                       flag("direction_times_pi")};
  options.scene_units = flag("scene_units");
  options.density = static_cast<DensityActivation>(static_cast<int>(get("density_activation", 0, 2)));
  options.pixel_centres = flag("pixel_centres");
  options.quadrature = {static_cast<int>(get("samples", 0, kMaxSamples)),
                        static_cast<int>(get("importance_samples", 0, kMaxSamples)),
                        flag("open_end")};
  options.bf16 = flag("bf16");
  options.device = flag("cuda") ? "cuda" : "cpu";
  return options;
}

}  // namespace

MlpOptions MlpOptionsOf(const MlpFieldOptions& options) {
  MlpOptions mlp;
  mlp.position_inputs = EncodedSize(options.position);
  mlp.direction_inputs = EncodedSize(options.direction);
  mlp.bf16 = options.bf16;
  mlp.device = options.device;
  return mlp;
}

MlpField::MlpField(const MlpFieldOptions& options, bool contracted, std::uint64_t seed)
    : options_(options), contracted_(contracted) {
  Build();
  std::size_t at = 0;
  for (std::size_t i = 0; i < networks_.size(); ++i) {
    const std::vector<float> initial = InitialWeights(mlp_, options.initialisation, seed + (i << 32));
    std::copy(initial.begin(), initial.end(), weights_.begin() + static_cast<std::ptrdiff_t>(at));
    at += initial.size();
  }
  Refresh();
}

MlpField::MlpField(const FieldConfig& config) : options_(OptionsFrom(config)) {
  const auto contracted = config.find("contracted");
  contracted_ = contracted != config.end() && contracted->second == 1;
  Build();
}

void MlpField::Build() {
  mlp_ = MlpOptionsOf(options_);
  const std::size_t n_networks = options_.quadrature.n_importance > 0 ? 2 : 1;
  for (std::size_t i = 0; i < n_networks; ++i) networks_.push_back(MakeMlp(mlp_));
  const std::size_t n_weights = n_networks * WeightCount(mlp_);
  weights_.assign(n_weights, 0.f);
  weights_m_.assign(n_weights, 0.f);
  weights_v_.assign(n_weights, 0.f);
}

FieldConfig MlpField::Config() const {
  return {{"position_frequencies", options_.position.frequencies},
          {"direction_frequencies", options_.direction.frequencies},
          {"identity", options_.position.identity},
          {"position_times_pi", options_.position.times_pi},
          {"direction_times_pi", options_.direction.times_pi},
          {"scene_units", options_.scene_units},
          {"contracted", contracted_},
          {"density_activation", static_cast<double>(options_.density)},
          {"pixel_centres", options_.pixel_centres},
          {"samples", options_.quadrature.n_samples},
          {"importance_samples", options_.quadrature.n_importance},
          {"open_end", options_.quadrature.open_end},
          {"bf16", options_.bf16},
          {"cuda", options_.device == "cuda"}};
}

std::vector<Tensor> MlpField::State() {
  return {{"weights", weights_}, {"weights_m", weights_m_}, {"weights_v", weights_v_}};
}

void MlpField::Refresh() {
  const auto n = static_cast<std::ptrdiff_t>(weights_per_network());
  for (std::size_t i = 0; i < networks_.size(); ++i) {
    const auto first = weights_.begin() + static_cast<std::ptrdiff_t>(i) * n;
    networks_[i]->SetWeights(std::vector<float>(first, first + n));
  }
}

void MlpField::EncodePositions(const Samples& samples, int first, int n, std::vector<float>* codes) const {
  const auto stride = static_cast<std::size_t>(CodeStride(mlp_.position_inputs));
  Grow(codes, static_cast<std::size_t>(n) * stride);
  const float scale = contracted_ ? 4.f : 2.f;
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
    const std::size_t s = static_cast<std::size_t>(first) + i;
    float p[3] = {samples.x[s], samples.y[s], samples.z[s]};
    if (!options_.scene_units) {
      for (float& value : p) value = scale * (value - 0.5f);
    }
    float* code = codes->data() + i * stride;
    PositionalEncoding(options_.position, p, code);
    for (auto j = static_cast<std::size_t>(mlp_.position_inputs); j < stride; ++j) code[j] = 0.f;
  }
}

void MlpField::EncodeDirection(const float direction[3], float* code) const {
  PositionalEncoding(options_.direction, direction, code);
  for (int j = mlp_.direction_inputs; j < CodeStride(mlp_.direction_inputs); ++j) code[j] = 0.f;
}

void MlpField::QueryDensity(const Samples& samples, float* sigma) const {
  thread_local CodeRows rows;
  const Mlp& network = *networks_.back();
  const int n = samples.size(), chunk = network.ChunkRows();
  for (int first = 0; first < n; first += chunk) {
    const int count = std::min(chunk, n - first);
    EncodePositions(samples, first, count, &rows.position_codes);
    network.Query(count, rows.position_codes.data(), nullptr, sigma + first, nullptr);
  }
  for (int i = 0; i < n; ++i) sigma[i] = Density(options_.density, sigma[i]);
}

void MlpField::Query(const Samples& samples,
                     std::span<const Ray> rays,
                     std::span<const int> ray_of,
                     int pass,
                     const ColourFilter& filter,
                     float* sigma,
                     float* rgb) const {
  thread_local CodeRows rows;
  const Mlp& network = *networks_[static_cast<std::size_t>(pass)];
  const auto stride = static_cast<std::size_t>(CodeStride(mlp_.direction_inputs));
  Grow(&rows.ray_codes, rays.size() * stride);
  for (std::size_t r = 0; r < rays.size(); ++r)
    EncodeDirection(rays[r].direction, &rows.ray_codes[r * stride]);
  const int n = samples.size(), chunk = network.ChunkRows();
  Grow(&rows.direction_codes, static_cast<std::size_t>(std::min(n, chunk)) * stride);
  for (int first = 0; first < n; first += chunk) {
    const int count = std::min(chunk, n - first);
    EncodePositions(samples, first, count, &rows.position_codes);
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      const auto ray = static_cast<std::size_t>(ray_of[static_cast<std::size_t>(first) + i]);
      std::memcpy(&rows.direction_codes[i * stride], &rows.ray_codes[ray * stride], stride * sizeof(float));
    }
    network.Query(
        count, rows.position_codes.data(), rows.direction_codes.data(), sigma + first, rgb + 3 * first);
  }
  for (int i = 0; i < n; ++i) sigma[i] = Density(options_.density, sigma[i]);
  for (int i = 0; i < 3 * n; ++i) rgb[i] = Sigmoid(rgb[i]);
  std::vector<std::uint8_t> wanted(static_cast<std::size_t>(n));  // all are there
  filter(0, n, sigma, wanted.data());
}

void MlpField::Step(double learning_rate, std::uint64_t step, float* gradients) {
  const auto t = static_cast<double>(step + 1);
  const auto rate = static_cast<float>(learning_rate / (1.0 - std::pow(double{kBeta1}, t)));
  const auto correction = static_cast<float>(1.0 / (1.0 - std::pow(double{kBeta2}, t)));
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    const float g = gradients[i];
    weights_m_[i] = kBeta1 * weights_m_[i] + (1.f - kBeta1) * g;
    weights_v_[i] = kBeta2 * weights_v_[i] + (1.f - kBeta2) * (g * g);
    weights_[i] -= rate * weights_m_[i] / (std::sqrt(weights_v_[i] * correction) + kEpsilon);
    gradients[i] = 0.f;
  }
  Refresh();
}

}  // namespace nerf
