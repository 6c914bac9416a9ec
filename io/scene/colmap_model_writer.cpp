// Writes a COLMAP sparse model as text or binary. Layout: https://colmap.github.io/format.html.
#include <fmt/format.h>

#include <bit>
#include <charconv>

#include "io/base/atomic_file.h"
#include "io/scene/colmap_model.h"
#include "io/scene/colmap_records.h"

namespace io {
namespace {

static_assert(std::endian::native == std::endian::little, "binary models are little-endian");

// Enough to restore every double.
constexpr int kDigits = 17;

void Append(std::string* text, double value) {
  char buffer[32];
  const auto end =
      std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general, kDigits).ptr;
  text->append(buffer, end);
}

template <typename Values>
void AppendAll(std::string* text, const Values& values) {
  for (const double value : values) {
    *text += ' ';
    Append(text, value);
  }
}

// The simplest model that loses nothing.
ColmapCameraRecord CameraRecord(const Camera& c) {
  ColmapCameraRecord record{.width = static_cast<std::uint64_t>(c.width),
                            .height = static_cast<std::uint64_t>(c.height)};
  const bool one_focal = c.fl_x == c.fl_y, tangential = c.p1 != 0 || c.p2 != 0;
  if (tangential || (!one_focal && c.HasDistortion())) {
    record.model = "OPENCV";
    record.params = {c.fl_x, c.fl_y, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2};
  } else if (!one_focal) {
    record.model = "PINHOLE";
    record.params = {c.fl_x, c.fl_y, c.cx, c.cy};
  } else if (c.k2 != 0) {
    record.model = "RADIAL";
    record.params = {c.fl_x, c.cx, c.cy, c.k1, c.k2};
  } else if (c.k1 != 0) {
    record.model = "SIMPLE_RADIAL";
    record.params = {c.fl_x, c.cx, c.cy, c.k1};
  } else {
    record.model = "SIMPLE_PINHOLE";
    record.params = {c.fl_x, c.cx, c.cy};
  }
  return record;
}

ColmapImageRecord ImageRecord(const Frame& frame) {
  const Rigid3d cam_from_world = FlipCameraAxes(frame.world_from_cam).Inverse();
  const Eigen::Quaterniond q(cam_from_world.rotation);
  const Eigen::Vector3d& t = cam_from_world.translation;
  return {.camera_id = static_cast<std::uint32_t>(frame.camera_index + 1),
          .quaternion_wxyz = {q.w(), q.x(), q.y(), q.z()},
          .translation = {t.x(), t.y(), t.z()},
          .name = frame.image_path.string(),
          .features = {}};
}

// Cameras and points count from 1. Feature k of a picture is its k-th observation.
ColmapRecords RecordsOf(const ColmapModel& model, const std::vector<std::uint32_t>& image_ids) {
  ColmapRecords records;
  for (const Camera& camera : model.scene.cameras) {
    records.cameras.push_back(CameraRecord(camera));
    records.cameras.back().id = static_cast<std::uint32_t>(records.cameras.size());
  }
  for (const Frame& frame : model.scene.frames) {
    records.images.push_back(ImageRecord(frame));
    const std::size_t n = records.images.size();
    records.images.back().id = image_ids.empty() ? static_cast<std::uint32_t>(n) : image_ids[n - 1];
  }
  for (const Point3D& point : model.scene.points) {
    records.points.push_back({.id = records.points.size() + 1,
                              .xyz = {point.xyz.x(), point.xyz.y(), point.xyz.z()},
                              .rgb = point.rgb,
                              .error_px = point.error_px,
                              .track = {}});
  }
  for (const Observation& observation : model.observations) {
    ColmapImageRecord& image = records.images[static_cast<std::size_t>(observation.frame_index)];
    ColmapPointRecord& point = records.points[static_cast<std::size_t>(observation.point_index)];
    point.track.push_back({image.id, static_cast<std::uint32_t>(image.features.size())});
    image.features.push_back({observation.xy.x(), observation.xy.y(), point.id});
  }
  return records;
}

void WriteTextFiles(const std::filesystem::path& folder, const ColmapRecords& records) {
  std::string cameras, images, points;
  for (const ColmapCameraRecord& camera : records.cameras) {
    cameras += fmt::format("{} {} {} {}", camera.id, camera.model, camera.width, camera.height);
    AppendAll(&cameras, camera.params);
    cameras += "\n";
  }
  for (const ColmapImageRecord& image : records.images) {
    images += std::to_string(image.id);
    AppendAll(&images, image.quaternion_wxyz);
    AppendAll(&images, image.translation);
    images += fmt::format(" {} {}\n", image.camera_id, image.name);
    for (const ColmapFeatureRecord& feature : image.features) {
      AppendAll(&images, std::initializer_list<double>{feature.x, feature.y});
      images += fmt::format(" {}", feature.point_id);
    }
    images += "\n";
  }
  for (const ColmapPointRecord& point : records.points) {
    points += std::to_string(point.id);
    AppendAll(&points, point.xyz);
    for (const int value : point.rgb) points += fmt::format(" {}", value);
    AppendAll(&points, std::initializer_list<double>{point.error_px});
    for (const ColmapTrackElement& element : point.track)
      points += fmt::format(" {} {}", element.image_id, element.feature_index);
    points += "\n";
  }
  WriteFileAtomically(folder / "cameras.txt", cameras);
  WriteFileAtomically(folder / "images.txt", images);
  WriteFileAtomically(folder / "points3D.txt", points);
}

template <typename Value>
void Put(std::string* bytes, const Value& value) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <typename Values>
void PutAll(std::string* bytes, const Values& values) {
  for (const auto& value : values) Put(bytes, value);
}

void WriteBinaryFiles(const std::filesystem::path& folder, const ColmapRecords& records) {
  std::string cameras, images, points;
  Put<std::uint64_t>(&cameras, records.cameras.size());
  for (const ColmapCameraRecord& camera : records.cameras) {
    Put(&cameras, camera.id);
    Put<std::int32_t>(&cameras, ColmapModelNumber(camera.model));
    PutAll(&cameras, std::initializer_list<std::uint64_t>{camera.width, camera.height});
    PutAll(&cameras, camera.params);
  }
  Put<std::uint64_t>(&images, records.images.size());
  for (const ColmapImageRecord& image : records.images) {
    Put(&images, image.id);
    PutAll(&images, image.quaternion_wxyz);
    PutAll(&images, image.translation);
    Put(&images, image.camera_id);
    images += image.name + '\0';
    Put<std::uint64_t>(&images, image.features.size());
    for (const ColmapFeatureRecord& feature : image.features) {
      PutAll(&images, std::initializer_list<double>{feature.x, feature.y});
      Put(&images, feature.point_id);
    }
  }
  Put<std::uint64_t>(&points, records.points.size());
  for (const ColmapPointRecord& point : records.points) {
    Put(&points, point.id);
    PutAll(&points, point.xyz);
    PutAll(&points, point.rgb);
    Put(&points, point.error_px);
    Put<std::uint64_t>(&points, point.track.size());
    for (const ColmapTrackElement& element : point.track)
      PutAll(&points, std::initializer_list<std::uint32_t>{element.image_id, element.feature_index});
  }
  WriteFileAtomically(folder / "cameras.bin", cameras);
  WriteFileAtomically(folder / "images.bin", images);
  WriteFileAtomically(folder / "points3D.bin", points);
}

}  // namespace

void WriteColmapModel(const std::filesystem::path& folder,
                      const ColmapModel& model,
                      ColmapForm form,
                      const std::vector<std::uint32_t>& image_ids) {
  const ColmapRecords records = RecordsOf(model, image_ids);
  if (form == ColmapForm::kText) {
    WriteTextFiles(folder, records);
  } else {
    WriteBinaryFiles(folder, records);
  }
}

}  // namespace io
