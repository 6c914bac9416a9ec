// Reads and writes point clouds as PLY. The writer makes one layout; the reader also takes the ASCII files
// and the extra or double-precision vertex properties that other programs write beside a transforms.json.
#include "io/scene/ply.h"

#include <fmt/format.h>

#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <sstream>

#include "io/base/atomic_file.h"
#include "io/base/check.h"

namespace io {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY bytes are copied as they lie in memory");

constexpr std::size_t kMaxHeaderBytes = 64 * 1024;  // real headers have a dozen short lines
constexpr std::size_t kBytesPerPoint = 3 * sizeof(float) + 3;
// What our header says of the observers, after the vertices.
constexpr char kObservation[] = "element observation ";
constexpr char kObservationProperties[] = "property int vertex\nproperty int frame\n";
constexpr std::size_t kBytesPerObservation = 2 * sizeof(std::int32_t);

enum class Scalar { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

struct Property {
  std::string name;
  Scalar type;
};

struct Header {
  bool is_ascii = false;
  std::size_t points = 0, observations = 0;  // observations: of files in our own layout
  std::vector<Property> properties;
  std::size_t size = 0;  // bytes up to and including the line "end_header"
};

[[noreturn]] void Fail(const std::filesystem::path& path, const std::string& what) {
  throw Error(ExitCode::kBadInput,
              path.string() + ": " + what,
              "Expected a PLY point cloud (ascii or binary_little_endian) with x, y, z");
}

std::size_t SizeOf(Scalar type) {
  switch (type) {
    case Scalar::kInt8:
    case Scalar::kUint8:
      return 1;
    case Scalar::kInt16:
    case Scalar::kUint16:
      return 2;
    case Scalar::kInt32:
    case Scalar::kUint32:
    case Scalar::kFloat:
      return 4;
    case Scalar::kDouble:
      break;
  }
  return 8;
}

Scalar ScalarFromName(const std::filesystem::path& path, const std::string& name) {
  if (name == "char" || name == "int8") return Scalar::kInt8;
  if (name == "uchar" || name == "uint8") return Scalar::kUint8;
  if (name == "short" || name == "int16") return Scalar::kInt16;
  if (name == "ushort" || name == "uint16") return Scalar::kUint16;
  if (name == "int" || name == "int32") return Scalar::kInt32;
  if (name == "uint" || name == "uint32") return Scalar::kUint32;
  if (name == "float" || name == "float32") return Scalar::kFloat;
  if (name == "double" || name == "float64") return Scalar::kDouble;
  Fail(path, "vertex property type '" + name.substr(0, 32) + "' is not supported");
}

std::size_t ParseCount(const std::filesystem::path& path, const std::string& text) {
  std::size_t count = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  if (error != std::errc() || stop != text.data() + text.size()) Fail(path, "bad element count");
  return count;
}

Header ParseHeader(const std::filesystem::path& path, const std::string& bytes) {
  Header header;
  const std::size_t end = bytes.substr(0, kMaxHeaderBytes).find("end_header\n");
  if (!bytes.starts_with("ply\n") || end == std::string::npos) Fail(path, "has no PLY header");
  header.size = end + std::strlen("end_header\n");
  std::istringstream lines(bytes.substr(4, end - 4));
  bool has_format = false, in_vertices = false, seen_vertices = false;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string keyword, first, second;
    words >> keyword >> first >> second;
    if (keyword == "format") {
      header.is_ascii = first == "ascii";
      has_format = header.is_ascii || first == "binary_little_endian";
      if (!has_format) Fail(path, "format '" + first.substr(0, 32) + "' is not supported");
    } else if (keyword == "element") {
      // Other elements may follow the vertices, but must not precede them: their size would have to be
      // understood.
      in_vertices = first == "vertex";
      if (!in_vertices && !seen_vertices) Fail(path, "the first element is not 'vertex'");
      if (!in_vertices) continue;
      if (seen_vertices) Fail(path, "has two vertex elements");
      seen_vertices = true;
      header.points = ParseCount(path, second);
    } else if (keyword == "property" && in_vertices) {
      header.properties.push_back({second, ScalarFromName(path, first)});
    }
  }
  if (!has_format || !seen_vertices) Fail(path, "states no format or no vertices");
  const std::size_t ours = bytes.substr(0, end).find(std::string("\n") + kObservation);
  if (ours != std::string::npos && bytes.substr(0, end).ends_with(kObservationProperties) &&
      !header.is_ascii) {
    const std::size_t first = ours + std::strlen(kObservation) + 1;
    header.observations = ParseCount(path, bytes.substr(first, bytes.find('\n', first) - first));
  }
  return header;
}

template <typename T>
double Load(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

double LoadScalar(Scalar type, const char* bytes) {
  switch (type) {
    case Scalar::kInt8:
      return Load<std::int8_t>(bytes);
    case Scalar::kUint8:
      return Load<std::uint8_t>(bytes);
    case Scalar::kInt16:
      return Load<std::int16_t>(bytes);
    case Scalar::kUint16:
      return Load<std::uint16_t>(bytes);
    case Scalar::kInt32:
      return Load<std::int32_t>(bytes);
    case Scalar::kUint32:
      return Load<std::uint32_t>(bytes);
    case Scalar::kFloat:
      return Load<float>(bytes);
    case Scalar::kDouble:
      break;
  }
  return Load<double>(bytes);
}

// The next number of an ASCII body; advances `at`.
double ParseScalar(const std::filesystem::path& path, const std::string& bytes, std::size_t* at) {
  while (*at < bytes.size() && std::strchr(" \t\r\n", bytes[*at])) ++*at;
  double value = 0;
  const auto [stop, error] = std::from_chars(bytes.data() + *at, bytes.data() + bytes.size(), value);
  if (error != std::errc()) Fail(path, fmt::format("byte {} is not the start of a number", *at));
  *at = static_cast<std::size_t>(stop - bytes.data());
  return value;
}

void ReadObservations(const std::filesystem::path& path,
                      const std::string& bytes,
                      std::size_t at,
                      std::size_t count,
                      std::vector<Point3D>* points) {
  if (count > (bytes.size() - at) / kBytesPerObservation)
    Fail(path, fmt::format("holds fewer than the {} observations it states", count));
  for (std::size_t i = 0; i < count; ++i, at += kBytesPerObservation) {
    std::int32_t vertex_frame[2];
    std::memcpy(vertex_frame, bytes.data() + at, sizeof vertex_frame);
    const auto vertex = static_cast<std::size_t>(vertex_frame[0]);
    if (vertex_frame[0] < 0 || vertex >= points->size() || vertex_frame[1] < 0)
      Fail(path, fmt::format("observation {} is out of range", i));
    (*points)[vertex].frame_indices.push_back(vertex_frame[1]);
  }
}

int FindProperty(const Header& header, const std::string& name) {
  for (std::size_t i = 0; i < header.properties.size(); ++i) {
    if (header.properties[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

}  // namespace

std::vector<Point3D> ReadPly(const std::filesystem::path& path) {
  const std::string bytes = ReadFile(path);
  const Header header = ParseHeader(path, bytes);
  const std::size_t n = header.properties.size();
  const int xyz[] = {FindProperty(header, "x"), FindProperty(header, "y"), FindProperty(header, "z")};
  const int rgb[] = {
      FindProperty(header, "red"), FindProperty(header, "green"), FindProperty(header, "blue")};
  for (int c = 0; c < 3; ++c) {
    if (xyz[c] < 0) Fail(path, "has no x, y and z");
    if (rgb[c] >= 0 && header.properties[static_cast<std::size_t>(rgb[c])].type != Scalar::kUint8)
      Fail(path, "colours are not 8-bit");
  }
  std::size_t row = 0;
  for (const Property& property : header.properties) row += SizeOf(property.type);
  // An ASCII number takes a digit and a blank at least, but for the blank after the last one. Compared by
  // division, so that no product can overflow.
  const std::size_t body = bytes.size() - header.size;
  if (header.points > (header.is_ascii ? (body + 1) / (2 * n) : body / row))
    Fail(path, fmt::format("holds fewer than the {} points it states", header.points));

  std::vector<Point3D> points(header.points);
  std::vector<double> values(n);
  std::size_t at = header.size;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = 0; k < n; ++k) {
      if (header.is_ascii) {
        values[k] = ParseScalar(path, bytes, &at);
      } else {
        values[k] = LoadScalar(header.properties[k].type, bytes.data() + at);
        at += SizeOf(header.properties[k].type);
      }
    }
    for (int c = 0; c < 3; ++c) {
      points[i].xyz[c] = values[static_cast<std::size_t>(xyz[c])];
      if (!std::isfinite(points[i].xyz[c])) Fail(path, fmt::format("point {} is not finite", i));
      if (std::abs(points[i].xyz[c]) > kMaxCoordinate)
        Fail(path, fmt::format("point {} lies further away than {:.0e}", i, kMaxCoordinate));
      if (rgb[c] < 0) continue;
      const double value = values[static_cast<std::size_t>(rgb[c])];
      if (!(value >= 0 && value <= 255)) Fail(path, fmt::format("point {} has a colour out of range", i));
      points[i].rgb[static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(value);
    }
  }
  ReadObservations(path, bytes, at, header.observations, &points);
  return points;
}

void WritePly(const std::filesystem::path& path, const std::vector<Point3D>& points) {
  std::size_t n_observations = 0;
  for (const Point3D& point : points) n_observations += point.frame_indices.size();
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n",
      points.size());
  if (n_observations > 0)
    bytes += fmt::format("{}{}\n{}", kObservation, n_observations, kObservationProperties);
  bytes += "end_header\n";
  bytes.reserve(bytes.size() + points.size() * kBytesPerPoint + n_observations * kBytesPerObservation);
  for (const Point3D& point : points) {
    for (int c = 0; c < 3; ++c) {
      const float value = static_cast<float>(point.xyz[c]);
      PIPELINE_CHECK(std::isfinite(value));
      bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
    bytes.append(reinterpret_cast<const char*>(point.rgb.data()), point.rgb.size());
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (const std::int32_t frame : points[i].frame_indices) {
      const std::int32_t vertex_frame[2] = {static_cast<std::int32_t>(i), frame};
      bytes.append(reinterpret_cast<const char*>(vertex_frame), sizeof vertex_frame);
    }
  }
  WriteFileAtomically(path, bytes);
}

}  // namespace io
