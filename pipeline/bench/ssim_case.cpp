// SSIM as evaluation takes it, as a case of `pipeline bench kernels`.
#include "io/base/random.h"
#include "nerf/metrics/metrics.h"
#include "pipeline/bench/kernel_cases.h"

namespace pipeline {
namespace {

io::Image Noise(int side, std::uint64_t seed) {
  io::Image image{.width = side, .height = side, .channels = 3, .data = {}};
  for (int i = 0; i < 3 * side * side; ++i) {
    io::Random random(seed, io::Stream::kInit, 0, static_cast<std::uint64_t>(i));
    image.data.push_back(static_cast<std::uint8_t>(random.Below(256)));
  }
  return image;
}

}  // namespace

KernelCase SsimCase(KernelData* data) {
  constexpr int kSide = 400;
  // Five windowed means, 11 taps along each axis, of three channels.
  constexpr double kOperations = 2.0 * 11 * 2 * 5 * 3;
  KernelCase c{.build = kAnyBuild, .kernel = "ssim", .format = "fp64", .item = "pixel", .unit = "GFLOP/s"};
  c.items = kSide * kSide;
  c.work = kOperations * c.items;
  c.run = [a = Noise(kSide, 1), b = Noise(kSide, 2), data] { data->ssim = nerf::Ssim(a, b); };
  return c;
}

}  // namespace pipeline
