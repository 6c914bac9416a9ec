// Chooses the build of the kernel once, by what the CPU and the operating system support.
#include <cstdlib>
#include <cstring>

#include "sfm/features/kernels/kernels.h"

namespace sfm::kernels {

extern const Kernel kPortableKernel;
#if defined(__x86_64__)
extern const Kernel kAvx2Kernel;
extern const Kernel kAvx512Kernel;
#endif

const Kernel* FindKernel(const char* name) {
  if (std::strcmp(name, "portable") == 0) return &kPortableKernel;
#if defined(__x86_64__)
  if (std::strcmp(name, "avx2") == 0 && __builtin_cpu_supports("avx2")) return &kAvx2Kernel;
  if (std::strcmp(name, "avx512") == 0 && __builtin_cpu_supports("avx512f") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vnni")) {
    return &kAvx512Kernel;
  }
#endif
  return nullptr;
}

const Kernel& ActiveKernel() {
  static const Kernel& active = []() -> const Kernel& {
    if (const char* wanted = std::getenv("PIPELINE_SIMD")) {
      if (const Kernel* found = FindKernel(wanted)) return *found;
    }
    for (const char* name : {"avx512", "avx2"}) {
      if (const Kernel* found = FindKernel(name)) return *found;
    }
    return kPortableKernel;
  }();
  return active;
}

}  // namespace sfm::kernels
