#include "nerf/fields/torch_mlp.h"

#include <ATen/core/ivalue.h>  // before ATen.h, which clang cannot compile as C++20 while IValue is incomplete

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <malloc.h>
#include <torch/csrc/autograd/autograd.h>
#include <torch/csrc/autograd/grad_mode.h>
#include <torch/version.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "io/base/check.h"
#include "io/base/error.h"
#include "io/process/parallel.h"
#include "nerf/fields/mlp.h"

namespace nerf {
namespace {

// 1024 rows of bfloat16 activations are 0.5 MB a layer: products run at full rate, and a chunk of the
// backward pass stays within the caches. A GPU needs more rows to fill it.
constexpr int kCpuRows = 1024, kGpuRows = 1 << 17;
// LibTorch makes and keeps machine code for every shape of a bfloat16 product. Few different numbers of rows
// keep that cheap, and its memory maps within the system's limit.
constexpr int kRowAlignment = 128;
constexpr int kGemmRows = 8192, kGemmWidth = 256, kGemmRepeats = 24;

class TorchMlp : public Mlp {
 public:
  explicit TorchMlp(const MlpOptions& options)
      : options_(options),
        layers_(Layers(options)),
        device_(options.device == "cuda" ? at::kCUDA : at::kCPU),
        type_(options.bf16 ? at::kBFloat16 : at::kFloat) {
    if (device_ == at::kCUDA && !at::hasCUDA()) {
      throw io::Error(
          io::ExitCode::kMissingTool, "--device cuda: the linked LibTorch has no CUDA", "Use --device cpu");
    }
  }

  void SetWeights(const std::vector<float>& weights) override {
    PIPELINE_CHECK_EQ(weights.size(), WeightCount(options_));
    at::NoGradGuard no_grad;
    leaves_.clear();
    for (const MlpLayer& layer : layers_) {
      const at::Tensor w =
          at::from_blob(const_cast<float*>(weights.data()) + layer.weights, {layer.outputs, layer.inputs});
      const at::Tensor b = at::from_blob(const_cast<float*>(weights.data()) + layer.biases, {layer.outputs});
      // The heads stay in float: three digits of density or colour would show.
      const at::ScalarType type = IsHead(layer) ? at::kFloat : type_;
      leaves_.push_back(Padded(layer, w).to(device_, type, false, true).set_requires_grad(true));
      leaves_.push_back(b.to(device_, type, false, true).set_requires_grad(true));
    }
  }

  int ChunkRows() const override { return device_ == at::kCUDA ? kGpuRows : kCpuRows; }

  void Query(int n,
             const float* position_codes,
             const float* direction_codes,
             float* density,
             float* logits) const override {
    at::set_num_threads(1);
    at::NoGradGuard no_grad;
    const auto [d, c] = Forward(n, position_codes, direction_codes);
    CopyOut(d, density);
    if (direction_codes) CopyOut(c, logits);
  }

  void Differentiate(int n,
                     const float* position_codes,
                     const float* direction_codes,
                     const Loss& loss,
                     float* weight_gradients) const override {
    at::set_num_threads(1);
    at::AutoGradMode with_grad(true);
    const auto [d, c] = Forward(n, position_codes, direction_codes);
    const at::Tensor d_host = d.detach().to(at::kCPU).contiguous(),
                     c_host = c.detach().to(at::kCPU).contiguous();
    const at::Tensor d_gradient = at::empty_like(d_host), c_gradient = at::empty_like(c_host);
    loss(d_host.data_ptr<float>(),
         c_host.data_ptr<float>(),
         d_gradient.data_ptr<float>(),
         c_gradient.data_ptr<float>());
    // grad() leaves the shared leaves alone, so threads can run backward passes side by side.
    const std::vector<at::Tensor> gradients =
        torch::autograd::grad({d, c}, leaves_, {d_gradient.to(device_), c_gradient.to(device_)});
    for (std::size_t l = 0; l < layers_.size(); ++l)
      AddGradients(layers_[l], &gradients[2 * l], weight_gradients);
  }

  std::string Describe() const override { return TorchVersion() + (options_.bf16 ? ", bf16" : ", fp32"); }

  double MeasureGemm(int n_threads) const override {
    const double flop = 2.0 * kGemmRows * kGemmWidth * kGemmWidth * kGemmRepeats * n_threads;
    const auto work = [&] {
      at::set_num_threads(1);
      at::NoGradGuard no_grad;
      const at::TensorOptions kind = at::TensorOptions().dtype(type_).device(device_);
      const at::Tensor x = at::ones({kGemmRows, kGemmWidth}, kind),
                       w = at::ones({kGemmWidth, kGemmWidth}, kind);
      at::Tensor y = at::mm(x, w);
      for (int i = 1; i < kGemmRepeats; ++i) at::mm_out(y, x, w);
      y[0][0].item<float>();  // waits for a GPU
    };
    double best = 0;
    for (int repeat = 0; repeat < 3; ++repeat) {
      const auto start = std::chrono::steady_clock::now();
      io::ParallelFor(static_cast<std::size_t>(n_threads), n_threads, [&](std::size_t) { work(); });
      const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      best = std::max(best, flop / seconds * 1e-9);
    }
    return best;
  }

 private:
  bool IsHead(const MlpLayer& layer) const {
    return &layer == &layers_.back() || &layer == &layers_[static_cast<std::size_t>(options_.depth)];
  }

  // The codes among a layer's inputs come padded, so the matrix gets columns of zeros there. The trunk's skip
  // layer reads (position code, h), the colour layer (feature, direction code).
  at::Tensor Padded(const MlpLayer& layer, const at::Tensor& w) const {
    const auto index = static_cast<int>(&layer - layers_.data());
    const int inputs = index == options_.depth + 2 ? options_.direction_inputs : options_.position_inputs;
    const int pad = CodeStride(inputs) - inputs;
    if (index == options_.depth + 2 || index == 0) return at::constant_pad_nd(w, {0, pad}, 0);
    if (index != options_.skip + 1 || index >= options_.depth) return w;
    const at::Tensor code = at::constant_pad_nd(w.narrow(1, 0, inputs), {0, pad}, 0);
    return at::cat({code, w.narrow(1, inputs, options_.width)}, 1);
  }

  at::Tensor Unpadded(const MlpLayer& layer, const at::Tensor& w) const {
    const auto index = static_cast<int>(&layer - layers_.data());
    if (w.size(1) == layer.inputs) return w;
    if (index != options_.skip + 1) return w.narrow(1, 0, layer.inputs);
    const int inputs = options_.position_inputs;
    return at::cat({w.narrow(1, 0, inputs), w.narrow(1, CodeStride(inputs), options_.width)}, 1);
  }

  at::Tensor Linear(std::size_t layer, const at::Tensor& x) const {
    return at::linear(x, leaves_[2 * layer], leaves_[2 * layer + 1]);
  }

  // Rows of codes in the working precision, padded with zero rows to a multiple of kRowAlignment.
  at::Tensor Code(int n, const float* codes, int inputs) const {
    const int padded = (n + kRowAlignment - 1) / kRowAlignment * kRowAlignment;
    const at::Tensor code =
        at::empty({padded, CodeStride(inputs)}, at::TensorOptions().dtype(type_).device(device_));
    code.narrow(0, 0, n).copy_(at::from_blob(const_cast<float*>(codes), {n, CodeStride(inputs)}));
    code.narrow(0, n, padded - n).zero_();
    return code;
  }

  // Density output [n] and colour logits [n][3] (undefined without direction codes), in float.
  std::pair<at::Tensor, at::Tensor> Forward(int n,
                                            const float* position_codes,
                                            const float* direction_codes) const {
    const at::Tensor code = Code(n, position_codes, options_.position_inputs);
    at::Tensor h = code;
    const auto depth = static_cast<std::size_t>(options_.depth);
    for (std::size_t l = 0; l < depth; ++l) {
      if (l == static_cast<std::size_t>(options_.skip) + 1) h = at::cat({code, h}, 1);
      h = Linear(l, h).relu_();
    }
    const at::Tensor density = Linear(depth, h.to(at::kFloat)).squeeze(1).narrow(0, 0, n);
    if (!direction_codes) return {density, {}};
    const at::Tensor direction = Code(n, direction_codes, options_.direction_inputs);
    const at::Tensor hidden = Linear(depth + 2, at::cat({Linear(depth + 1, h), direction}, 1)).relu_();
    return {density, Linear(depth + 3, hidden.to(at::kFloat)).narrow(0, 0, n)};
  }

  static void CopyOut(const at::Tensor& values, float* out) {
    at::from_blob(out, values.sizes()).copy_(values);
  }

  void AddGradients(const MlpLayer& layer, const at::Tensor* gradients, float* out) const {
    at::NoGradGuard no_grad;
    const at::Tensor w = Unpadded(layer, gradients[0]).to(at::kCPU);
    at::from_blob(out + layer.weights, {layer.outputs, layer.inputs}).add_(w);
    at::from_blob(out + layer.biases, {layer.outputs}).add_(gradients[1].to(at::kCPU));
  }

  MlpOptions options_;
  std::vector<MlpLayer> layers_;
  at::DeviceType device_;
  at::ScalarType type_;
  std::vector<at::Tensor> leaves_;  // weight and bias of each layer, in the working precision
};

}  // namespace

void UseTorch() {
  // Activations of a chunk come and go thousands of times. Keeping their memory instead of returning it to
  // the system saves a page fault per 4 KB, which costs more than the arithmetic on it.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  SetMlpFactory(
      [](const MlpOptions& options) -> std::unique_ptr<Mlp> { return std::make_unique<TorchMlp>(options); });
}

std::string TorchVersion() {
  return std::string("LibTorch ") + TORCH_VERSION + (at::hasCUDA() ? " (CUDA)" : " (CPU)");
}

}  // namespace nerf
