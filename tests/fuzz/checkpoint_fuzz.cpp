// A checkpoint's header, under a right length and hash, and the tensors behind it. A file that starts with
// the magic is tried as it is, too.
#include <cstring>

#include "io/base/hash.h"
#include "nerf/fields/checkpoint.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

void Read(std::string_view file) {
  const auto path = fuzz::Write("checkpoint.bin", file);
  nerf::TrainState state;
  fuzz::MayRefuse([&] { nerf::ReadCheckpoint(path, &state); });
  fuzz::MayRefuse([&] { nerf::KindOfCheckpoint(path); });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::string_view kMagic = "NERFCKP8";
  const std::vector<std::string> files = fuzz::Files(data, size);
  if (files[0].starts_with(kMagic)) Read({reinterpret_cast<const char*>(data), size});
  const auto length = static_cast<std::uint32_t>(files[0].size());
  std::string file(kMagic);
  file.append(reinterpret_cast<const char*>(&length), sizeof length);
  file += io::HashBytes(files[0]) + files[0];
  if (files.size() > 1) file += files[1];
  Read(file);
  return 0;
}
