// The avx512bf16 build of the kernels; compile flags are set in nerf/CMakeLists.txt.
#define KERNELS_NAME "avx512bf16"
#define KERNELS_TABLE kAvx512Bf16Kernels
#include "nerf/kernels/simd_kernels.inc"
