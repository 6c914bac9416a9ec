// The multilayer perceptron of the original NeRF [Mildenhall et al. 2020, fig. 7], as a function of its
// weights:
//
//   h = 8 x relu(linear 256) of the position code, which enters again beside the fifth activation
//   density output = linear 1 (h);   feature = linear 256 (h)
//   colour logits  = linear 3 (relu(linear 128 (feature, direction code)))
//
// With codes of 63 and 27 values (encoding 10/4 with the identity) these are 593,408 multiply-adds per
// sample. Weights are one array owned by the caller: per layer W [outputs][inputs], then the biases
// [outputs]. Implementations: LibTorch (torch_mlp.cpp), and a plain reference in double in the tests.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace nerf {

struct MlpOptions {
  int position_inputs = 63, direction_inputs = 27;
  int depth = 8, width = 256, skip = 4;  // the position code enters again behind layer `skip` (from 0)
  int colour_width = 128;
  bool bf16 = false;           // products of bfloat16 with float sums; weights and moments stay float
  std::string device = "cpu";  // or "cuda", where the linked LibTorch has it
};

struct MlpLayer {
  const char* name;
  int inputs, outputs;
  std::size_t weights, biases;  // offsets
};

// In the order of the weight array: trunk layers, density, feature, colour hidden, colour.
std::vector<MlpLayer> Layers(const MlpOptions& options);
std::size_t WeightCount(const MlpOptions& options);
double MultiplyAdds(const MlpOptions& options);  // per sample

enum class Initialisation {
  kXavier,   // weights uniform within sqrt(6 / (inputs + outputs)), biases 0 [Glorot & Bengio 2010], as Keras
             // does
  kUniform,  // weights and biases uniform within 1 / sqrt(inputs), as LibTorch's and PyTorch's Linear does
};
std::vector<float> InitialWeights(const MlpOptions& options,
                                  Initialisation initialisation,
                                  std::uint64_t seed);

// Rows of codes are padded with zeros to a multiple of this many floats: matrix products like aligned rows.
inline constexpr int kCodeAlignment = 32;
inline int CodeStride(int inputs) { return (inputs + kCodeAlignment - 1) / kCodeAlignment * kCodeAlignment; }

class Mlp {
 public:
  virtual ~Mlp() = default;

  // Takes over new weights [WeightCount]. Not while another call is running.
  virtual void SetWeights(const std::vector<float>& weights) = 0;

  // Rows that go through the network together.
  virtual int ChunkRows() const = 0;

  // Outputs for n rows of codes (strides CodeStride): density [n] before its activation, and logits [n][3]
  // unless direction_codes is null. Safe to call from several threads; each call computes on its own thread.
  virtual void Query(int n,
                     const float* position_codes,
                     const float* direction_codes,
                     float* density,
                     float* logits) const = 0;

  // The same, then calls `loss`, which looks at the outputs and writes d loss / d density [n] and d loss / d
  // logits [n][3], and adds d loss / d weights to weight_gradients [WeightCount].
  using Loss = std::function<void(
      const float* density, const float* logits, float* density_gradients, float* logit_gradients)>;
  virtual void Differentiate(int n,
                             const float* position_codes,
                             const float* direction_codes,
                             const Loss& loss,
                             float* weight_gradients) const = 0;

  // "LibTorch 1.13.0, bf16"; and the rate in GFLOP/s of a product [8192][256] x [256][256] on n_threads
  // threads at once.
  virtual std::string Describe() const = 0;
  virtual double MeasureGemm(int n_threads) const = 0;
};

// Whether bfloat16 products are faster than float ones: on GPUs, and on CPUs with instructions for them.
bool PrefersBf16(const std::string& device);

// LibTorch takes 0.4 s and 160 MB to load, so only programs that need it link it: they call UseTorch() of
// torch_mlp.h first. MakeMlp throws kMissingTool in others.
using MlpFactory = std::unique_ptr<Mlp> (*)(const MlpOptions&);
void SetMlpFactory(MlpFactory factory);
bool HasMlpFactory();
std::unique_ptr<Mlp> MakeMlp(const MlpOptions& options);

}  // namespace nerf
