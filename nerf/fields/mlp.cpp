#include "nerf/fields/mlp.h"

#include <cmath>

#include "io/base/error.h"
#include "io/base/random.h"

namespace nerf {
namespace {

MlpFactory factory = nullptr;

}  // namespace

std::vector<MlpLayer> Layers(const MlpOptions& options) {
  std::vector<MlpLayer> layers;
  std::size_t at = 0;
  const auto add = [&](const char* name, int inputs, int outputs) {
    const std::size_t count = static_cast<std::size_t>(inputs) * static_cast<std::size_t>(outputs);
    layers.push_back({name, inputs, outputs, at, at + count});
    at += count + static_cast<std::size_t>(outputs);
  };
  for (int l = 0; l < options.depth; ++l) {
    const int inputs = l == 0                  ? options.position_inputs
                       : l == options.skip + 1 ? options.position_inputs + options.width
                                               : options.width;
    add("trunk", inputs, options.width);
  }
  add("density", options.width, 1);
  add("feature", options.width, options.width);
  add("colour hidden", options.width + options.direction_inputs, options.colour_width);
  add("colour", options.colour_width, 3);
  return layers;
}

std::size_t WeightCount(const MlpOptions& options) {
  const MlpLayer last = Layers(options).back();
  return last.biases + static_cast<std::size_t>(last.outputs);
}

double MultiplyAdds(const MlpOptions& options) {
  double sum = 0;
  for (const MlpLayer& layer : Layers(options)) sum += static_cast<double>(layer.inputs) * layer.outputs;
  return sum;
}

std::vector<float> InitialWeights(const MlpOptions& options,
                                  Initialisation initialisation,
                                  std::uint64_t seed) {
  std::vector<float> weights(WeightCount(options), 0.f);
  for (const MlpLayer& layer : Layers(options)) {
    const bool xavier = initialisation == Initialisation::kXavier;
    const float limit = xavier ? std::sqrt(6.f / static_cast<float>(layer.inputs + layer.outputs))
                               : 1.f / std::sqrt(static_cast<float>(layer.inputs));
    const std::size_t end = layer.biases + (xavier ? 0 : static_cast<std::size_t>(layer.outputs));
    for (std::size_t i = layer.weights; i < end; ++i)
      weights[i] = limit * (2.f * io::Random(seed, io::Stream::kInit, 0, i).Uniform() - 1.f);
  }
  return weights;
}

bool PrefersBf16(const std::string& device) {
  if (device == "cuda") return true;
#if defined(__x86_64__)
  return __builtin_cpu_supports("avx512bf16");
#else
  return false;
#endif
}

void SetMlpFactory(MlpFactory new_factory) { factory = new_factory; }

bool HasMlpFactory() { return factory != nullptr; }

std::unique_ptr<Mlp> MakeMlp(const MlpOptions& options) {
  if (!factory) throw io::Error(io::ExitCode::kInternal, "this program was started without LibTorch");
  return factory(options);
}

}  // namespace nerf
