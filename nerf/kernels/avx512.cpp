// The avx512 build of the kernels; compile flags are set in nerf/CMakeLists.txt.
#define KERNELS_NAME "avx512"
#define KERNELS_TABLE kAvx512Kernels
#include "nerf/kernels/simd_kernels.inc"
