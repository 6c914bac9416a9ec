// What the fuzz targets share: an input as files, and what counts as a finding.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "io/base/error.h"

namespace fuzz {

// Between the files of one input.
inline constexpr std::string_view kNextFile = "\n--next file--\n";

inline std::vector<std::string> Files(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  std::vector<std::string> files;
  for (;;) {
    const std::size_t end = rest.find(kNextFile);
    files.emplace_back(rest.substr(0, end));
    if (end == std::string_view::npos) return files;
    rest.remove_prefix(end + kNextFile.size());
  }
}

// A folder of this process, in memory where there is such a file system.
inline const std::filesystem::path& Folder() {
  static const std::filesystem::path folder = [] {
    const bool has_memory = std::filesystem::is_directory("/dev/shm");
    std::filesystem::path path = has_memory ? "/dev/shm" : std::filesystem::temp_directory_path();
    path /= "pipeline_fuzz_" + std::to_string(getpid());
    std::filesystem::create_directories(path);
    std::atexit([] { std::filesystem::remove_all(Folder()); });
    return path;
  }();
  return folder;
}

inline std::filesystem::path Write(const std::string& name, std::string_view bytes) {
  const std::filesystem::path path = Folder() / name;
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return path;
}

// Refusing an input is right, as long as the input is to blame. Whatever else leaves `read` ends the process.
template <typename Read>
void MayRefuse(const Read& read) {
  try {
    read();
  } catch (const io::Error& error) {
    if (error.code() == io::ExitCode::kInternal) std::abort();
  }
}

}  // namespace fuzz
