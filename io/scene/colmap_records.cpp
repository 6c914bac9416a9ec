// Parsers of the binary and the text form.
#include "io/scene/colmap_records.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <string_view>

#include "io/base/atomic_file.h"

namespace io {
namespace {

namespace fs = std::filesystem;

struct CameraModel {
  const char* name;
  int params;
};
// In the order of COLMAP's model numbers; the later ones exist so that a good file of theirs is not called
// damaged.
constexpr CameraModel kCameraModels[] = {{"SIMPLE_PINHOLE", 3},
                                         {"PINHOLE", 4},
                                         {"SIMPLE_RADIAL", 4},
                                         {"RADIAL", 5},
                                         {"OPENCV", 8},
                                         {"OPENCV_FISHEYE", 8},
                                         {"FULL_OPENCV", 12},
                                         {"FOV", 5},
                                         {"SIMPLE_RADIAL_FISHEYE", 4},
                                         {"RADIAL_FISHEYE", 5},
                                         {"THIN_PRISM_FISHEYE", 12},
                                         {"RAD_TAN_THIN_PRISM_FISHEYE", 16}};

// Bytes of a binary file, consumed front to back; never reads past the end.
class ByteCursor {
 public:
  explicit ByteCursor(const fs::path& path) : path_(path), bytes_(ReadFile(path)) {}

  template <typename T>
  T Take(const std::string& what) {
    if (Remaining() < sizeof(T)) RefuseModel(path_, "ends inside " + what);
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }

  // A count of records that take at least `min_bytes` each.
  std::size_t TakeCount(std::size_t min_bytes, const std::string& what) {
    const auto count = Take<std::uint64_t>(what);
    if (count > Remaining() / min_bytes) {
      RefuseModel(path_, fmt::format("states {} {} but ends before them", count, what));
    }
    return static_cast<std::size_t>(count);
  }

  std::string TakeName(const std::string& what) {
    const std::size_t end = bytes_.find('\0', at_);
    if (end == std::string::npos) RefuseModel(path_, "ends inside the name of " + what);
    std::string name = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return name;
  }

  void ExpectEnd() const {
    if (Remaining() > 0) RefuseModel(path_, fmt::format("has {} bytes after its last record", Remaining()));
  }

 private:
  std::size_t Remaining() const { return bytes_.size() - at_; }

  fs::path path_;
  std::string bytes_;
  std::size_t at_ = 0;
};

void ReadBinary(ColmapRecords* records) {
  ByteCursor cameras(records->cameras_path);
  // id, model number, width, height
  for (std::size_t n = cameras.TakeCount(24, "cameras"); n > 0; --n) {
    ColmapCameraRecord camera;
    camera.id = cameras.Take<std::uint32_t>("a camera");
    const auto model = cameras.Take<std::int32_t>("a camera");
    if (model < 0 || model >= static_cast<int>(std::size(kCameraModels))) {
      RefuseModel(records->cameras_path,
                  fmt::format("camera {} has the undefined model number {}", camera.id, model));
    }
    camera.model = kCameraModels[model].name;
    camera.width = cameras.Take<std::uint64_t>("a camera");
    camera.height = cameras.Take<std::uint64_t>("a camera");
    for (int i = 0; i < kCameraModels[model].params; ++i)
      camera.params.push_back(cameras.Take<double>("a camera"));
    records->cameras.push_back(std::move(camera));
  }
  cameras.ExpectEnd();

  ByteCursor images(records->images_path);
  // id, quaternion, translation, camera id, empty name, feature count
  for (std::size_t n = images.TakeCount(73, "images"); n > 0; --n) {
    ColmapImageRecord image;
    image.id = images.Take<std::uint32_t>("an image");
    const std::string label = fmt::format("image {}", image.id);
    for (double& value : image.quaternion_wxyz) value = images.Take<double>(label);
    for (double& value : image.translation) value = images.Take<double>(label);
    image.camera_id = images.Take<std::uint32_t>(label);
    image.name = images.TakeName(label);
    image.features.resize(images.TakeCount(24, "features of " + label));
    for (ColmapFeatureRecord& feature : image.features) {
      feature.x = images.Take<double>(label);
      feature.y = images.Take<double>(label);
      feature.point_id = images.Take<std::uint64_t>(label);
    }
    records->images.push_back(std::move(image));
  }
  images.ExpectEnd();

  ByteCursor points(records->points_path);
  // id, xyz, rgb, error, track length
  for (std::size_t n = points.TakeCount(51, "points"); n > 0; --n) {
    ColmapPointRecord point;
    point.id = points.Take<std::uint64_t>("a point");
    const std::string label = fmt::format("point {}", point.id);
    for (double& value : point.xyz) value = points.Take<double>(label);
    for (std::uint8_t& value : point.rgb) value = points.Take<std::uint8_t>(label);
    point.error_px = points.Take<double>(label);
    point.track.resize(points.TakeCount(8, "track elements of " + label));
    for (ColmapTrackElement& element : point.track) {
      element.image_id = points.Take<std::uint32_t>(label);
      element.feature_index = points.Take<std::uint32_t>(label);
    }
    records->points.push_back(std::move(point));
  }
  points.ExpectEnd();
}

// Lines of a text file, comments skipped; fields are separated by blanks.
class TextCursor {
 public:
  explicit TextCursor(const fs::path& path) : path_(path), text_(ReadFile(path)) {}

  // The next line with data; false at the end. Blank lines count as data only after NextLineMayBeEmpty.
  bool NextRecord() {
    while (NextRawLine()) {
      SkipBlanks();
      if (!rest_.empty() && rest_[0] != '#') return true;
    }
    return false;
  }
  void NextLineMayBeEmpty() {
    if (!NextRawLine()) rest_ = {};
  }

  bool AtLineEnd() {
    SkipBlanks();
    return rest_.empty();
  }

  std::string_view TakeWord() {
    if (AtLineEnd()) RefuseModel(path_, fmt::format("line {} ends too early", line_));
    const std::string_view word = rest_.substr(0, rest_.find_first_of(" \t"));
    rest_.remove_prefix(word.size());
    return word;
  }

  template <typename T>
  T Take() {
    const std::string_view word = TakeWord();
    T value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) {
      RefuseModel(path_, fmt::format("line {}: '{}' is not a number in range", line_, word.substr(0, 40)));
    }
    return value;
  }

  std::string TakeRest() {
    SkipBlanks();
    while (!rest_.empty() && (rest_.back() == ' ' || rest_.back() == '\t')) rest_.remove_suffix(1);
    return std::string(rest_);
  }

 private:
  bool NextRawLine() {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    rest_ = std::string_view(text_).substr(at_, end - at_);
    if (!rest_.empty() && rest_.back() == '\r') rest_.remove_suffix(1);
    at_ = end + 1;
    ++line_;
    return true;
  }
  void SkipBlanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size())); }

  fs::path path_;
  std::string text_;
  std::string_view rest_;
  std::size_t at_ = 0;
  int line_ = 0;
};

void ReadText(ColmapRecords* records) {
  TextCursor cameras(records->cameras_path);
  while (cameras.NextRecord()) {
    ColmapCameraRecord camera;
    camera.id = cameras.Take<std::uint32_t>();
    camera.model = std::string(cameras.TakeWord());
    camera.width = cameras.Take<std::uint64_t>();
    camera.height = cameras.Take<std::uint64_t>();
    while (!cameras.AtLineEnd()) camera.params.push_back(cameras.Take<double>());
    records->cameras.push_back(std::move(camera));
  }

  TextCursor images(records->images_path);
  while (images.NextRecord()) {
    ColmapImageRecord image;
    image.id = images.Take<std::uint32_t>();
    for (double& value : image.quaternion_wxyz) value = images.Take<double>();
    for (double& value : image.translation) value = images.Take<double>();
    image.camera_id = images.Take<std::uint32_t>();
    image.name = images.TakeRest();  // names may hold blanks
    images.NextLineMayBeEmpty();
    while (!images.AtLineEnd()) {
      ColmapFeatureRecord feature;
      feature.x = images.Take<double>();
      feature.y = images.Take<double>();
      feature.point_id = static_cast<std::uint64_t>(images.Take<std::int64_t>());  // -1: kNoPoint
      image.features.push_back(feature);
    }
    records->images.push_back(std::move(image));
  }

  TextCursor points(records->points_path);
  while (points.NextRecord()) {
    ColmapPointRecord point;
    point.id = points.Take<std::uint64_t>();
    for (double& value : point.xyz) value = points.Take<double>();
    for (std::uint8_t& value : point.rgb) value = points.Take<std::uint8_t>();
    point.error_px = points.Take<double>();
    while (!points.AtLineEnd()) {
      ColmapTrackElement element;
      element.image_id = points.Take<std::uint32_t>();
      element.feature_index = points.Take<std::uint32_t>();
      point.track.push_back(element);
    }
    records->points.push_back(std::move(point));
  }
}

}  // namespace

[[noreturn]] void RefuseModel(const fs::path& path, const std::string& what) {
  throw Error(ExitCode::kBadState, path.string() + ": " + what, "The model is damaged; reconstruct it again");
}

int ColmapParamCount(const std::string& model) {
  for (const CameraModel& known : kCameraModels) {
    if (model == known.name) return known.params;
  }
  return -1;
}

int ColmapModelNumber(const std::string& model) {
  int number = 0;
  while (kCameraModels[number].name != model) ++number;
  return number;
}

ColmapRecords ReadColmapRecords(const fs::path& folder) {
  for (const char* extension : {".bin", ".txt"}) {
    ColmapRecords records;
    records.cameras_path = folder / (std::string("cameras") + extension);
    records.images_path = folder / (std::string("images") + extension);
    records.points_path = folder / (std::string("points3D") + extension);
    if (!fs::is_regular_file(records.cameras_path) || !fs::is_regular_file(records.images_path) ||
        !fs::is_regular_file(records.points_path)) {
      continue;
    }
    std::string(extension) == ".bin" ? ReadBinary(&records) : ReadText(&records);
    return records;
  }
  throw Error(ExitCode::kBadInput,
              folder.string() + ": no COLMAP model (cameras, images and points3D as .bin or .txt)",
              "Name the folder that holds these three files");
}

}  // namespace io
