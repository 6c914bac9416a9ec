// The portable build of the kernels; compile flags are set in nerf/CMakeLists.txt.
#define KERNELS_NAME "portable"
#define KERNELS_TABLE kPortableKernels
#include "nerf/kernels/simd_kernels.inc"
