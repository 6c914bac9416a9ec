// Chooses the build of the kernels once, by what the CPU and the operating system support.
#include <cstdlib>
#include <cstring>
#include <initializer_list>

#include "nerf/kernels/kernels.h"

namespace nerf::kernels {

extern const Kernels kPortableKernels;
#if defined(__x86_64__)
extern const Kernels kAvx2Kernels;
extern const Kernels kAvx512Kernels;
extern const Kernels kAvx512Bf16Kernels;
#endif

const Kernels* FindKernels(const char* name) {
  if (std::strcmp(name, "portable") == 0) return &kPortableKernels;
#if defined(__x86_64__)
  if (std::strcmp(name, "avx2") == 0 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    return &kAvx2Kernels;
  }
  const bool avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
                      __builtin_cpu_supports("fma");
  if (std::strcmp(name, "avx512") == 0 && avx512) return &kAvx512Kernels;
  if (std::strcmp(name, "avx512bf16") == 0 && avx512 && __builtin_cpu_supports("avx512bf16"))
    return &kAvx512Bf16Kernels;
#endif
  return nullptr;
}

const Kernels& ActiveKernels() {
  static const Kernels& active = []() -> const Kernels& {
    if (const char* wanted = std::getenv("PIPELINE_SIMD")) {
      if (const Kernels* found = FindKernels(wanted)) return *found;
    }
    for (const char* name : {"avx512bf16", "avx512", "avx2"}) {
      if (const Kernels* found = FindKernels(name)) return *found;
    }
    return kPortableKernels;
  }();
  return active;
}

bool HasBf16Products() { return &ActiveKernels() == FindKernels("avx512bf16"); }

}  // namespace nerf::kernels
