// The avx2 build of the kernels; compile flags are set in nerf/CMakeLists.txt.
#define KERNELS_NAME "avx2"
#define KERNELS_TABLE kAvx2Kernels
#include "nerf/kernels/simd_kernels.inc"
