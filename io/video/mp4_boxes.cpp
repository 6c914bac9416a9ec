#include "io/video/mp4_boxes.h"

#include <unistd.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace io {
namespace {

struct Box {
  std::int64_t begin = 0, end = 0;  // payload, file offsets
};

template <std::size_t n>
std::optional<std::array<unsigned char, n>> ReadBytes(int fd, std::int64_t offset) {
  std::array<unsigned char, n> bytes;
  if (pread(fd, bytes.data(), n, offset) != static_cast<ssize_t>(n)) return std::nullopt;
  return bytes;
}

std::uint64_t BigEndian(const unsigned char* bytes, int n) {
  std::uint64_t value = 0;
  for (int i = 0; i < n; ++i) value = value << 8 | bytes[i];
  return value;
}

// The first box of `type` within `parent`, from the file offset *cursor on, which moves behind it.
std::optional<Box> NextBox(int fd, const Box& parent, std::string_view type, std::int64_t* cursor) {
  constexpr int kMaxBoxes = 10000;  // fragmented recordings have many, but their index comes first
  for (int i = 0; i < kMaxBoxes && *cursor <= parent.end - 8; ++i) {
    const auto head = ReadBytes<8>(fd, *cursor);
    if (!head) return std::nullopt;
    std::uint64_t size = BigEndian(head->data(), 4);
    std::int64_t header = 8;
    if (size == 1) {  // a 64-bit size follows
      const auto large = ReadBytes<8>(fd, *cursor + 8);
      if (!large) return std::nullopt;
      size = BigEndian(large->data(), 8);
      header = 16;
    }
    const auto left = static_cast<std::uint64_t>(parent.end - *cursor);
    if (size == 0) size = left;  // to the end
    if (size < static_cast<std::uint64_t>(header) || size > left) return std::nullopt;
    const Box box = {*cursor + header, *cursor + static_cast<std::int64_t>(size)};
    *cursor = box.end;
    if (std::string_view(reinterpret_cast<const char*>(head->data()) + 4, 4) == type) return box;
  }
  return std::nullopt;
}

std::optional<Box> FindBox(int fd, const std::optional<Box>& parent, std::string_view type) {
  if (!parent) return std::nullopt;
  std::int64_t cursor = parent->begin;
  return NextBox(fd, *parent, type, &cursor);
}

// The matrix of the track header maps stored to shown positions: x' = a x + c y, y' = b x + d y in 16.16.
int OrientationOf(int fd, const Box& track_header) {
  const auto version = ReadBytes<1>(fd, track_header.begin);
  if (!version) return 1;
  const std::int64_t matrix = track_header.begin + ((*version)[0] == 1 ? 52 : 40);
  const auto bytes = ReadBytes<20>(fd, matrix);  // a b u c d
  if (!bytes) return 1;
  const auto sign = [&](int offset) {
    const auto value = static_cast<std::int32_t>(BigEndian(bytes->data() + offset, 4));
    return value > 0 ? 1 : value < 0 ? -1 : 0;
  };
  const int a = sign(0), b = sign(4), c = sign(12), d = sign(16);
  if (a == 0 && d == 0 && b == 1 && c == -1) return 6;  // shown turned by 90 degrees clockwise
  if (a == 0 && d == 0 && b == -1 && c == 1) return 8;
  if (b == 0 && c == 0 && a == -1 && d == -1) return 3;
  return 1;
}

}  // namespace

Mp4Header ReadMp4Header(int fd) {
  Mp4Header header;
  const std::optional<Box> movie = FindBox(fd, Box{0, lseek(fd, 0, SEEK_END)}, "moov");
  header.has_index = movie.has_value();
  std::int64_t cursor = movie ? movie->begin : 0;
  while (const auto track = movie ? NextBox(fd, *movie, "trak", &cursor) : std::nullopt) {
    const auto media_kind = FindBox(fd, FindBox(fd, track, "mdia"), "hdlr");
    const auto track_header = FindBox(fd, track, "tkhd");
    if (!media_kind || !track_header) continue;
    const auto kind = ReadBytes<4>(fd, media_kind->begin + 8);
    if (kind && std::string_view(reinterpret_cast<const char*>(kind->data()), 4) == "vide") {
      header.orientation = OrientationOf(fd, *track_header);
      break;
    }
  }
  return header;
}

}  // namespace io
