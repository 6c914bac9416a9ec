#include "pipeline/stages/run_secret.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/random.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <thread>

#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "io/process/interrupt.h"

namespace pipeline {
namespace {

constexpr std::chrono::milliseconds kLook(100);
constexpr std::size_t kBytes = 16;

// Empty while it is missing or incomplete.
std::string Read(const std::filesystem::path& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (fd < 0) return "";
  char text[2 * kBytes] = "";
  const ssize_t n = read(fd, text, sizeof text);
  close(fd);
  return n == sizeof text ? std::string(text, sizeof text) : "";
}

void Write(const std::filesystem::path& path) {
  std::array<unsigned char, kBytes> random;
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600);
  std::string text;
  const bool is_random = getrandom(random.data(), kBytes, 0) == static_cast<ssize_t>(kBytes);
  for (const unsigned char byte : random) text += fmt::format("{:02x}", byte);
  const bool is_written =
      fd >= 0 && is_random && write(fd, text.data(), text.size()) == ssize_t(text.size()) && fsync(fd) == 0;
  const int fault = errno;
  if (fd >= 0) close(fd);
  if (!is_written)
    throw io::Error(io::ExitCode::kNoResources,
                    path.string() + ": cannot be written (" + std::strerror(fault) + ")");
}

}  // namespace

std::string RunSecret(const std::filesystem::path& out, bool is_first, std::chrono::seconds patience) {
  const std::filesystem::path path = out / ".ranks.secret";
  if (is_first && Read(path).empty()) {
    io::ClaimFolder(out);
    Write(path);
  }
  const auto end = std::chrono::steady_clock::now() + patience;
  for (std::string secret;; std::this_thread::sleep_for(kLook)) {
    if (!(secret = Read(path)).empty()) return secret;
    io::ThrowIfInterrupted();
    if (std::chrono::steady_clock::now() > end) {
      throw io::Error(
          io::ExitCode::kLostRank,
          fmt::format("{}: rank 0 has not written it within {} s", path.string(), patience.count()),
          "Start all ranks with one --out, on a file system that all can reach");
    }
  }
}

}  // namespace pipeline
