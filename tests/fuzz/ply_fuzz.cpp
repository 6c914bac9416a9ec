// Sparse points as PLY.
#include "io/scene/ply.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto path = fuzz::Write("points.ply", {reinterpret_cast<const char*>(data), size});
  fuzz::MayRefuse([&] { io::ReadPly(path); });
  return 0;
}
