// transforms.json beside three pictures, with points.ply as second file.
#include "io/image/image.h"
#include "io/scene/transforms.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool has_pictures = [] {
    std::filesystem::create_directories(fuzz::Folder() / "images");
    for (const char* name : {"a.png", "b.png", "c.jpg"})
      io::WriteImage(fuzz::Folder() / "images" / name, io::MakeImage(8, 6, 3));
    return true;
  }();
  const std::vector<std::string> files = fuzz::Files(data, size);
  fuzz::Write("points.ply", files.size() > 1 ? files[1] : "");
  const std::filesystem::path json = fuzz::Write("transforms.json", files[0]);
  fuzz::MayRefuse([&] {
    if (has_pictures) io::ReadTransforms(json);
  });
  return 0;
}
