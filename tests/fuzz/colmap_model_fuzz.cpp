// A COLMAP model: cameras, images and points3D; text where the first file begins with a comment, else binary.
#include "io/scene/colmap_model.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::vector<std::string> files = fuzz::Files(data, size);
  files.resize(3);
  const bool is_text = files[0].starts_with('#');
  const char* names[] = {"cameras", "images", "points3D"};
  for (std::size_t i = 0; i < 3; ++i) {
    fuzz::Write(std::string(names[i]) + (is_text ? ".txt" : ".bin"), files[i]);
    std::filesystem::remove(fuzz::Folder() / (std::string(names[i]) + (is_text ? ".bin" : ".txt")));
  }
  fuzz::MayRefuse([] { io::ReadColmapModel(fuzz::Folder()); });
  return 0;
}
