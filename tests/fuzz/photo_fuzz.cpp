// A photo of any kind: header, tags, pixels.
#include "io/image/photo.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::MayRefuse([&] { io::DecodePhoto({reinterpret_cast<const char*>(data), size}, 64); });
  return 0;
}
