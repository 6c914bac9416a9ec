// The boxes of an MP4 file.
#include <fcntl.h>
#include <unistd.h>

#include "io/video/mp4_boxes.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto path = fuzz::Write("video.mp4", {reinterpret_cast<const char*>(data), size});
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) std::abort();
  fuzz::MayRefuse([&] { io::ReadMp4Header(fd); });
  close(fd);
  return 0;
}
