#include "pipeline/ingest/picture_source.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <glob.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <new>
#include <set>
#include <system_error>

#include "io/base/error.h"
#include "io/base/natural_order.h"
#include "io/image/media_type.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using io::MediaType;
namespace fs = std::filesystem;

constexpr off_t kMaxPictureBytes =
    1 << 30;                           // far above any photo within the limit of io/image/photo_codecs.h
constexpr std::size_t kMaxStem = 100;  // leaves room below the 255 bytes of a file name

std::string Lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

std::string WhatIsAccepted() {
  return std::string("Give a folder or a quoted pattern of photos (") + io::kAcceptedPhotos +
         "), or one video (" + io::kAcceptedVideos + ")";
}

bool HasPictureName(const fs::path& path) {
  static const std::set<std::string> kExtensions = {
      ".jpg", ".jpeg", ".jpe", ".png", ".tif", ".tiff", ".webp", ".heic", ".heif", ".avif", ".gif", ".bmp"};
  return kExtensions.count(Lower(path.extension().string())) > 0;
}

// A descriptor that is sure to be a regular file; O_NONBLOCK keeps a fifo from hanging the open.
class RegularFile {
 public:
  explicit RegularFile(const fs::path& path) : path_(path) {
    fd_ = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (fd_ < 0 || fstat(fd_, &status_) != 0) {
      const int error = errno;
      if (fd_ >= 0) close(fd_);
      throw Error(ExitCode::kBadInput,
                  PrintableName(path.string()) + ": cannot be read (" + std::strerror(error) + ")",
                  "Check its permissions");
    }
  }
  ~RegularFile() { close(fd_); }
  RegularFile(const RegularFile&) = delete;
  RegularFile& operator=(const RegularFile&) = delete;

  const struct stat& status() const { return status_; }

  std::string Read(std::size_t size) const {
    std::string bytes(size, '\0');
    std::size_t done = 0;
    while (done < size) {
      const ssize_t n = read(fd_, bytes.data() + done, size - done);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) throw Error(ExitCode::kBadInput, PrintableName(path_.string()) + ": read error");
      if (n == 0) break;
      done += static_cast<std::size_t>(n);
    }
    bytes.resize(done);
    return bytes;
  }

  bool IsUnchanged() const {
    struct stat now = {};
    return fstat(fd_, &now) == 0 && now.st_size == status_.st_size &&
           now.st_mtim.tv_sec == status_.st_mtim.tv_sec && now.st_mtim.tv_nsec == status_.st_mtim.tv_nsec;
  }

 private:
  fs::path path_;
  int fd_;
  struct stat status_ = {};
};

// What stands in the way of opening `path` at all; empty when nothing does. `root`: symbolic links must stay
// below it.
std::string Obstacle(const fs::path& path, const fs::path& root) {
  const std::string name = path.filename().string();
  if (std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; })) {
    return "a line break or control character in its name. Rename it";
  }
  std::error_code error;
  if (fs::is_symlink(path, error)) {
    const fs::path target = fs::canonical(path, error);
    if (error) return "a symbolic link that leads nowhere";
    const fs::path relative = target.lexically_relative(fs::canonical(root));
    if (relative.empty() || *relative.begin() == "..") return "a symbolic link to a place outside the folder";
  }
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) return "a folder";
  if (!fs::is_regular_file(status)) return "not a regular file";
  return "";
}

MediaType TypeOf(const fs::path& path, std::string* obstacle) {
  const RegularFile file(path);
  if (!S_ISREG(file.status().st_mode)) *obstacle = "not a regular file";
  if (file.status().st_size == 0) *obstacle = "empty file";
  return obstacle->empty() ? io::MediaTypeOf(file.Read(io::kMediaTypeBytes)) : MediaType::kUnknown;
}

std::vector<fs::path> ListFolder(const fs::path& folder) {
  std::vector<fs::path> paths;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (it->path().filename().string()[0] != '.') paths.push_back(it->path());  // .DS_Store and the like
  }
  if (error == std::errc::not_enough_memory) throw std::bad_alloc();
  if (error) {
    throw Error(ExitCode::kBadInput,
                PrintableName(folder.string()) + ": cannot be read (" + error.message() + ")",
                "Check its permissions");
  }
  return paths;
}

std::vector<fs::path> ListPattern(const fs::path& pattern) {
  std::vector<fs::path> paths;
  glob_t matches = {};
  if (glob(pattern.c_str(), 0, nullptr, &matches) == 0) {
    for (std::size_t i = 0; i < matches.gl_pathc; ++i) paths.emplace_back(matches.gl_pathv[i]);
  }
  globfree(&matches);
  return paths;
}

// Sorts `paths` into pictures, videos and the rest.
PictureSource Classify(std::vector<fs::path> paths, const fs::path& input) {
  std::sort(paths.begin(), paths.end(), [](const fs::path& a, const fs::path& b) {
    return io::NaturalLess(a.string(), b.string());
  });
  PictureSource source;
  std::vector<fs::path> videos;
  for (const fs::path& path : paths) {
    std::string reason = Obstacle(path, path.has_parent_path() ? path.parent_path() : ".");
    const MediaType type = reason.empty() ? TypeOf(path, &reason) : MediaType::kUnknown;
    if (io::IsPhoto(type)) {
      source.files.push_back(path);
      continue;
    }
    if (io::IsVideo(type)) {
      videos.push_back(path);
      continue;
    }
    const bool is_bad = HasPictureName(path) || type != MediaType::kUnknown;
    if (reason.empty()) {
      reason = type == MediaType::kUnknown
                   ? "its content is not a picture"
                   : std::string(io::MediaTypeName(type)) + ": convert it to PNG or JPEG";
    }
    source.refused.push_back({{PrintableName(path.filename().string()), reason}, is_bad});
  }
  if (source.files.empty() && videos.size() == 1) {
    source.is_video = true;
    source.files = videos;
    return source;
  }
  if (source.files.empty() && videos.size() > 1) {
    throw Error(ExitCode::kBadInput,
                fmt::format("{}: holds {} videos and no photo", PrintableName(input.string()), videos.size()),
                "Give one of the videos by name");
  }
  for (const fs::path& video : videos) {
    source.refused.push_back(
        {{PrintableName(video.filename().string()), "a video among photos. Give it by itself"}, false});
  }
  return source;
}

}  // namespace

PictureSource FindPictures(const fs::path& input) {
  const std::string name = PrintableName(input.string());
  std::error_code error;
  const fs::file_status status = fs::status(input, error);
  if (fs::is_regular_file(status)) {
    std::string obstacle;
    const MediaType type = TypeOf(input, &obstacle);
    if (obstacle.empty() && !io::IsPhoto(type) && !io::IsVideo(type)) {
      obstacle = type == MediaType::kUnknown ? "its content is neither a picture nor a video"
                                             : std::string(io::MediaTypeName(type)) + " is not read";
    }
    if (!obstacle.empty()) throw Error(ExitCode::kBadInput, name + ": " + obstacle, WhatIsAccepted());
    return {.is_video = io::IsVideo(type), .files = {input}, .refused = {}};
  }
  const bool is_folder = fs::is_directory(status);
  const bool is_pattern = !is_folder && input.string().find_first_of("*?[") != std::string::npos;
  if (!is_folder && !is_pattern) {
    const bool exists = fs::exists(status);
    throw Error(ExitCode::kBadInput,
                name + (exists ? ": neither a folder nor a regular file" : ": no such file or folder"),
                WhatIsAccepted());
  }
  PictureSource source = Classify(is_folder ? ListFolder(input) : ListPattern(input), input);
  if (source.files.empty()) {
    std::string found = source.refused.empty() ? "nothing in it" : "no usable picture in it";
    for (std::size_t i = 0; i < std::min<std::size_t>(3, source.refused.size()); ++i) {
      const DroppedPicture& picture = source.refused[i].picture;
      found += (i == 0 ? " (" : "; ") + picture.source + ": " + picture.reason;
    }
    if (!source.refused.empty()) found += source.refused.size() > 3 ? "; ...)" : ")";
    throw Error(ExitCode::kBadInput, name + ": " + found, WhatIsAccepted());
  }
  return source;
}

std::string ReadPictureFile(const fs::path& path) {
  const RegularFile file(path);
  const std::string name = PrintableName(path.string());
  if (!S_ISREG(file.status().st_mode)) throw Error(ExitCode::kBadInput, name + ": not a regular file");
  if (file.status().st_size > kMaxPictureBytes) {
    throw Error(ExitCode::kBadInput, name + ": larger than 1 GiB", "Convert it to JPEG");
  }
  std::string bytes = file.Read(static_cast<std::size_t>(file.status().st_size));
  if (bytes.size() != static_cast<std::size_t>(file.status().st_size) || !file.IsUnchanged()) {
    throw Error(
        ExitCode::kBadInput, name + ": changed while it was read", "Run again when copying has ended");
  }
  return bytes;
}

std::string PrintableName(const std::string& name) {
  const auto byte = [&](std::size_t i) { return i < name.size() ? static_cast<unsigned char>(name[i]) : 0u; };
  std::string printable;
  for (std::size_t i = 0; i < name.size();) {
    const unsigned first = byte(i);
    const std::size_t length = first < 0x80       ? 1
                               : first >> 5 == 6  ? 2
                               : first >> 4 == 14 ? 3
                               : first >> 3 == 30 ? 4
                                                  : 0;
    bool valid = length > 0 && first >= 0x20 && first != 0x7f;
    std::uint32_t code = first & (0xffu >> (length + 1));
    for (std::size_t k = 1; k < length; ++k) {
      valid = valid && byte(i + k) >> 6 == 2;
      code = code << 6 | (byte(i + k) & 0x3f);
    }
    constexpr std::array<std::uint32_t, 5> kSmallest = {0, 0, 0x80, 0x800, 0x10000};
    const bool is_surrogate = length == 3 && code >> 11 == 0x1b;
    valid = valid && (length == 1 || code >= kSmallest[length]) && code <= 0x10ffff && !is_surrogate;
    if (valid) {
      printable += name.substr(i, length);
      i += length;
    } else {
      printable += fmt::format("\\x{:02x}", first);
      ++i;
    }
  }
  return printable;
}

std::vector<std::string> SafeStems(const std::vector<fs::path>& files) {
  std::vector<std::string> stems;
  std::set<std::string> used;  // in lower case: some file systems do not tell case
  for (const fs::path& file : files) {
    std::string stem = file.stem().string().substr(0, kMaxStem);
    for (char& c : stem) {
      if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_' && c != '-') c = '_';
    }
    if (stem[0] == '-' || stem[0] == '.') stem[0] = '_';  // neither an option nor a hidden file
    std::string unique = stem;
    for (int n = 2; !used.insert(Lower(unique)).second; ++n) unique = fmt::format("{}_{}", stem, n);
    stems.push_back(unique);
  }
  return stems;
}

}  // namespace pipeline
