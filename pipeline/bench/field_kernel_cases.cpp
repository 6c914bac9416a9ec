// The kernels of the `hash` field as training calls them, as cases of `pipeline bench kernels`.
#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "io/base/random.h"
#include "nerf/sampling/occupancy_grid.h"
#include "pipeline/bench/kernel_cases.h"

namespace pipeline {
namespace {

namespace kernels = nerf::kernels;
using kernels::Bf16;
using kernels::Epilogue;

constexpr int kRows = 512;        // a chunk of hash_shard.cpp
constexpr int kMaxWidth = 64;     // of the networks' layers
constexpr int kInputs = 32;       // values per row of features
constexpr int kResolution = 512;  // cells per axis of the level: consecutive points lie 2.6 cells apart

template <typename Real>
constexpr const char* kFormat = sizeof(Real) == 2 ? "bf16" : "fp32";

// Rows of one chunk, and one layer.
template <typename Real>
struct LayerData {
  nerf::AlignedVector<Real> x, mask, y, packed, features;
  nerf::AlignedVector<float> sums, w_gradient, logits;

  explicit LayerData(const kernels::NetworkKernels<Real>& layers)
      : y(kRows * kMaxWidth), packed(kMaxWidth * kMaxWidth), features(kRows * kInputs) {
    nerf::AlignedVector<float> random(kRows * kMaxWidth);
    for (std::size_t i = 0; i < random.size(); ++i)
      random[i] = 2 * io::Random(9, io::Stream::kInit, 0, i).Uniform() - 1;
    x.resize(random.size());
    layers.round(kRows, kMaxWidth, random.data(), x.data(), kMaxWidth);
    mask = x;
    layers.pack(kMaxWidth, kMaxWidth, random.data(), packed.data());
    sums.resize(random.size());
    w_gradient.resize(kMaxWidth * kMaxWidth);
    logits.assign(random.begin(), random.begin() + 3 * kRows);
  }
};

// Rays of length 1/2 through a grid of which a random half is occupied, so that none jumps.
struct MarchData {
  static constexpr int kRays = 512, kIntervals = 64;

  MarchData() {
    for (std::uint32_t i = 0; i < grid.n_cells(); ++i) {
      const bool is_occupied = io::Random(6, io::Stream::kInit, 0, i).Below(2) == 0;
      is_occupied ? grid.SetCandidate(i) : grid.SetEmpty(i);
    }
    grid.Rebuild();
    for (int i = 0; i < 3 * kRays; ++i) {
      io::Random random(8, io::Stream::kRay, 0, static_cast<std::uint64_t>(i));
      start[i / kRays].push_back(0.3f + 0.4f * random.Uniform());
      slope[i / kRays].push_back(0.5f * random.Uniform() - 0.25f);  // at most 0.3 away
    }
    for (nerf::AlignedVector<float>* slot : {&st, &sd, &sx, &sy, &sz}) slot->resize(kRays * kIntervals);
    cell.resize(st.size());
  }
  void March(const kernels::Kernels& build) {
    t.assign(kRays, 0.f);
    build.march(grid.Blocks(),
                {{start[0].data(), start[1].data(), start[2].data()},
                 {slope[0].data(), slope[1].data(), slope[2].data()},
                 t_last.data(),
                 false},
                {.step_size = 1.f / kIntervals, .cell_length = 1.f / 128},
                kRays,
                kIntervals,
                t.data(),
                count.data(),
                {st.data(), sd.data(), sx.data(), sy.data(), sz.data(), cell.data()});
  }

  nerf::OccupancyGrid grid{128, nerf::SceneContraction{}};
  nerf::AlignedVector<float> start[3], slope[3], t, t_last = nerf::AlignedVector<float>(kRays, 1.f);
  std::vector<int> count = std::vector<int>(kRays);
  nerf::AlignedVector<float> st, sd, sx, sy, sz;
  std::vector<std::uint32_t> cell;
};

class CaseList {
 public:
  CaseList(const std::string& build, KernelData* data)
      : build_(build), kernels_(*kernels::FindKernels(build.c_str())), data_(data) {}

  std::vector<KernelCase> Take() {
    AddNetwork<float>();
    AddNetwork<Bf16>();
    AddElementary("exp", kernels_.exp, kRows, 21);
    AddElementary("one_minus_exp_neg", kernels_.one_minus_exp_neg, kRows, 37);
    AddElementary("sigmoid", kernels_.sigmoid, 3 * kRows, 23);
    AddMarch();
    for (const bool per_entry : {false, true}) {
      const std::string name = per_entry ? "step_entries" : "adam";
      AddOptimiser(name, per_entry, data_->dense);
      AddOptimiser(name + ", 10 % touched", per_entry, data_->sparse);
    }
    return std::move(cases_);
  }

 private:
  KernelCase& Add(const std::string& kernel, const char* format, const char* item, double items) {
    cases_.push_back({.build = build_, .kernel = kernel, .format = format, .item = item, .items = items});
    return cases_.back();
  }
  // The build's own products of bfloat16; builds that widen them are held against float.
  std::string ArithmeticLimit(const std::string& format) const {
    const bool has_products = format == "bf16" && build_ == "avx512bf16";
    return KernelCase{.build = build_, .kernel = kArithmetic, .format = has_products ? "bf16" : "fp32"}
        .Name();
  }
  void AddArithmetic(const std::string& kernel,
                     const char* format,
                     const char* item,
                     double items,
                     double operations_per_item,
                     std::function<void()> run) {
    KernelCase& c = Add(kernel, format, item, items);
    c.unit = "GFLOP/s";
    c.work = items * operations_per_item;
    c.limit = ArithmeticLimit(format);
    c.run = std::move(run);
  }

  template <typename Real>
  void AddNetwork();
  template <typename Real>
  void AddGrid(int log2_entries, const std::shared_ptr<LayerData<Real>>& rows);
  template <typename Real>
  void AddLayer(int k, int m, Epilogue epilogue, const std::shared_ptr<LayerData<Real>>& rows);
  template <typename Real>
  void AddHead(const std::shared_ptr<LayerData<Real>>& rows);
  void AddElementary(const char* name, void (*kernel)(int, float*), int n, double operations);
  void AddMarch();
  void AddOptimiser(const std::string& name, bool per_entry, const nerf::AlignedVector<float>& gradients);

  const std::string build_;
  const kernels::Kernels& kernels_;
  KernelData* data_;
  std::vector<KernelCase> cases_;
};

template <typename Real>
void CaseList::AddNetwork() {
  const auto rows = std::make_shared<LayerData<Real>>(kernels_.Network<Real>());
  for (int log2 = kMinLog2Entries; log2 <= kMaxLog2Entries; ++log2) AddGrid(log2, rows);
  // With the epilogues of hash_network.cpp.
  AddLayer(32, 64, Epilogue::kRelu, rows);
  AddLayer(64, 64, Epilogue::kRelu, rows);
  AddLayer(64, 16, Epilogue::kNone, rows);
  AddLayer(16, 64, Epilogue::kMask, rows);
  AddLayer(64, 32, Epilogue::kNone, rows);
  AddHead(rows);
}

// Of the look-ups' format as well: float tables for float networks, rounded ones for rounded networks.
template <typename Real>
void CaseList::AddGrid(int log2_entries, const std::shared_ptr<LayerData<Real>>& rows) {
  const kernels::NetworkKernels<Real>& grid = kernels_.Network<Real>();
  const std::size_t entries = std::size_t{1} << log2_entries;
  const kernels::GridLevel level{kResolution, static_cast<std::uint32_t>(entries - 1), 0, entries};
  const auto n = static_cast<double>(data_->x.size());
  // Chunk by chunk through all positions.
  const auto add = [&, data = data_](const char* name, const char* access, const char* bytes, auto&& chunk) {
    KernelCase& c = Add(name + Power(log2_entries), kFormat<Real>, "sample", n);
    c.unit = "G accesses/s";
    c.work = 8 * n;  // the corners of a cell
    c.limit = KernelCase{.build = kAnyBuild, .kernel = access + Power(log2_entries), .format = bytes}.Name();
    c.run = [chunk, data] {
      for (std::size_t i = 0; i + kRows <= data->x.size(); i += kRows)
        chunk(&data->x[i], &data->y[i], &data->z[i]);
    };
  };
  add("encode",
      kGather,
      sizeof(Real) == 2 ? "8B" : "16B",
      [=, &grid, data = data_](const float* x, const float* y, const float* z) {
        if constexpr (sizeof(Real) == 2) {
          grid.encode_bf16(level, data->rounded.data(), x, y, z, kRows, rows->features.data(), kInputs);
        } else {
          grid.encode(level, data->table.data(), x, y, z, kRows, rows->features.data(), kInputs);
        }
      });
  add("position_gradient",
      kGather,
      sizeof(Real) == 2 ? "8B" : "16B",
      [=, &grid, data = data_](const float* x, const float* y, const float* z) {
        float* const to[3] = {rows->sums.data(), rows->sums.data() + kRows, rows->sums.data() + 2 * kRows};
        if constexpr (sizeof(Real) == 2) {
          grid.position_gradient_bf16(level, data->rounded.data(), rows->x.data(), x, y, z, kRows, to);
        } else {
          grid.position_gradient(level, data->table.data(), rows->x.data(), x, y, z, kRows, to);
        }
      });
  add("scatter", kUpdate, "16B", [=, &grid, data = data_](const float* x, const float* y, const float* z) {
    grid.scatter(level, rows->x.data(), x, y, z, kRows, data->gradient.data());
  });
}

template <typename Real>
void CaseList::AddLayer(int k, int m, Epilogue epilogue, const std::shared_ptr<LayerData<Real>>& rows) {
  const kernels::NetworkKernels<Real>& layers = kernels_.Network<Real>();
  const std::string size = fmt::format("{}x{}", k, m);
  const bool keeps_sums = k == 64 && m == 16;  // the density network's outputs stay float
  AddArithmetic("matmul " + size, kFormat<Real>, "sample", kRows, 2.0 * k * m, [=, &layers] {
    LayerData<Real>& r = *rows;
    if (keeps_sums) {
      layers.matmul_sums(kRows, k, m, r.x.data(), r.packed.data(), r.sums.data());
    } else {
      layers.matmul(kRows, k, m, r.x.data(), r.packed.data(), epilogue, r.mask.data(), r.y.data());
    }
  });
  AddArithmetic("matmul_gradient " + size, kFormat<Real>, "sample", kRows, 2.0 * k * m, [=, &layers] {
    layers.matmul_gradient(kRows, k, m, rows->x.data(), rows->mask.data(), rows->w_gradient.data());
  });
}

template <typename Real>
void CaseList::AddHead(const std::shared_ptr<LayerData<Real>>& rows) {
  const kernels::NetworkKernels<Real>& layers = kernels_.Network<Real>();
  constexpr int k = kMaxWidth;
  // Weights and sums of three outputs are float in both formats, and so are the products.
  AddArithmetic("head", kFormat<Real>, "sample", kRows, 2.0 * 3 * k, [=, &layers] {
    layers.head(kRows, k, rows->x.data(), rows->w_gradient.data(), rows->sums.data());
  });
  cases_.back().limit = ArithmeticLimit("fp32");
  const auto weights = std::make_shared<nerf::AlignedVector<float>>(3 * k, 0.25f);
  AddArithmetic("head_gradient", kFormat<Real>, "sample", kRows, 4.0 * 3 * k, [=, &layers] {
    LayerData<Real>& r = *rows;
    layers.head_gradient(
        kRows, k, r.x.data(), weights->data(), r.logits.data(), r.y.data(), r.w_gradient.data());
  });
  cases_.back().limit = ArithmeticLimit("fp32");
}

// operations: additions, products and quotients per value in elementary.inc. In place again and again:
// values stay finite, and no branch depends on them.
void CaseList::AddElementary(const char* name, void (*kernel)(int, float*), int n, double operations) {
  const auto values = std::make_shared<nerf::AlignedVector<float>>(n, 0.75f);
  AddArithmetic(name, "fp32", "element", n, operations, [=] { kernel(n, values->data()); });
}

// Per interval the kernel reads a distance and a word of cells, in as many blocks as a table of 2^15 entries.
void CaseList::AddMarch() {
  const auto data = std::make_shared<MarchData>();
  KernelCase& c = Add("march", "fp32", "interval", MarchData::kRays * MarchData::kIntervals);
  c.unit = "G accesses/s";
  c.work = 2 * c.items;
  c.limit = KernelCase{.build = kAnyBuild, .kernel = kGather + Power(15), .format = "8B"}.Name();
  c.run = [data, all = kernels_] { data->March(all); };
}

// Bytes that a step must move: every gradient, and for 64-byte lines of them that hold one which is not zero
// the cleared gradients, values and moments there and back, and the rounded copy.
double OptimiserBytes(const nerf::AlignedVector<float>& gradients, bool per_entry, bool rounded) {
  constexpr std::size_t kLine = 16;
  const double moments = per_entry ? 16 : 2 * 64, touched = 64 + 2 * (64 + moments) + (rounded ? 32 : 0);
  double bytes = 0;
  for (std::size_t i = 0; i + kLine <= gradients.size(); i += kLine) {
    const bool is_touched = std::any_of(&gradients[i], &gradients[i] + kLine, [](float g) { return g != 0; });
    bytes += 64 + (is_touched ? touched : 0);
  }
  return bytes;
}

void CaseList::AddOptimiser(const std::string& name,
                            bool per_entry,
                            const nerf::AlignedVector<float>& gradients) {
  const kernels::AdamStep step{.learning_rate = 1e-2f, .correction1 = 10, .correction2 = 100};
  const std::size_t n = gradients.size();
  for (const bool rounded : {false, true}) {
    KernelCase& c = Add(name, rounded ? "bf16" : "fp32", "element", static_cast<double>(n));
    c.unit = "GB/s";
    c.work = OptimiserBytes(gradients, per_entry, rounded);
    const std::string size = fmt::format("{}MiB", 4 * n * sizeof(float) >> 20);
    c.limit = KernelCase{.build = kAnyBuild, .kernel = kStreamUpdate, .format = size}.Name();
    c.prepare = [data = data_, &gradients] { data->step_gradient = gradients; };
    c.run = [=, data = data_, all = kernels_] {
      float *g = data->step_gradient.data(), *v = data->v.data(), *values = data->values.data();
      kernels::Bf16* copy = rounded ? data->step_rounded.data() : nullptr;
      if (per_entry) {
        all.step_entries(step, n / kernels::kFeatures, g, v, values, copy);
      } else {
        all.adam(step, n, g, data->m.data(), v, values, copy);
      }
    };
  }
}

}  // namespace

std::vector<KernelCase> FieldKernelCases(const std::string& build, KernelData* data) {
  return CaseList(build, data).Take();
}

}  // namespace pipeline
