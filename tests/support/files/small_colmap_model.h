// Support for tests: a small COLMAP model, written in both of COLMAP's forms.
#pragma once

#include <cmath>
#include <fstream>
#include <string>

#include "io/scene/colmap_records.h"
#include "tests/support/files/temp_dir.h"

template <typename T>
void Put(std::string* bytes, T value) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

inline void WriteBinary(const io::ColmapRecords& records, const std::filesystem::path& folder) {
  std::string cameras, images, points;
  Put<std::uint64_t>(&cameras, records.cameras.size());
  for (const auto& camera : records.cameras) {
    Put(&cameras, camera.id);
    Put<std::int32_t>(&cameras, camera.model == "SIMPLE_RADIAL" ? 2 : camera.model == "OPENCV" ? 4 : 5);
    Put(&cameras, camera.width);
    Put(&cameras, camera.height);
    for (double value : camera.params) Put(&cameras, value);
  }
  Put<std::uint64_t>(&images, records.images.size());
  for (const auto& image : records.images) {
    Put(&images, image.id);
    for (double value : image.quaternion_wxyz) Put(&images, value);
    for (double value : image.translation) Put(&images, value);
    Put(&images, image.camera_id);
    images += image.name + '\0';
    Put<std::uint64_t>(&images, image.features.size());
    for (const auto& feature : image.features) {
      Put(&images, feature.x);
      Put(&images, feature.y);
      Put(&images, feature.point_id);
    }
  }
  Put<std::uint64_t>(&points, records.points.size());
  for (const auto& point : records.points) {
    Put(&points, point.id);
    for (double value : point.xyz) Put(&points, value);
    for (std::uint8_t value : point.rgb) Put(&points, value);
    Put(&points, point.error_px);
    Put<std::uint64_t>(&points, point.track.size());
    for (const auto& element : point.track) {
      Put(&points, element.image_id);
      Put(&points, element.feature_index);
    }
  }
  WriteText(folder / "cameras.bin", cameras);
  WriteText(folder / "images.bin", images);
  WriteText(folder / "points3D.bin", points);
}

inline void WriteText(const io::ColmapRecords& records, const std::filesystem::path& folder) {
  std::ofstream cameras(folder / "cameras.txt"), images(folder / "images.txt"),
      points(folder / "points3D.txt");
  for (std::ofstream* out : {&cameras, &images, &points}) {
    out->precision(17);
    *out << "# comment\n";
  }
  for (const auto& camera : records.cameras) {
    cameras << camera.id << " " << camera.model << " " << camera.width << " " << camera.height;
    for (double value : camera.params) cameras << " " << value;
    cameras << "\n";
  }
  for (const auto& image : records.images) {
    images << image.id;
    for (double value : image.quaternion_wxyz) images << " " << value;
    for (double value : image.translation) images << " " << value;
    images << " " << image.camera_id << " " << image.name << "\n";
    for (const auto& f : image.features) {
      images << f.x << " " << f.y << " " << static_cast<std::int64_t>(f.point_id) << " ";
    }
    images << "\n";
  }
  for (const auto& point : records.points) {
    points << point.id;
    for (double value : point.xyz) points << " " << value;
    for (int value : point.rgb) points << " " << value;
    points << " " << point.error_px;
    for (const auto& element : point.track) points << " " << element.image_id << " " << element.feature_index;
    points << "\n";
  }
}

// Three pictures (one of them without features), two cameras, four points. Every observation lies exactly 1
// px beside the projection.
inline io::ColmapRecords SmallModel() {
  io::ColmapRecords records;
  records.cameras = {
      {.id = 7, .model = "SIMPLE_RADIAL", .width = 640, .height = 480, .params = {500, 320, 240, 0.1}},
      {.id = 3,
       .model = "OPENCV",
       .width = 320,
       .height = 240,
       .params = {300, 310, 160, 120, 0.05, -0.01, 1e-3, -2e-3}}};
  const io::Camera cameras[] = {{640, 480, 500, 500, 320, 240, 0.1, 0, 0, 0},
                                {320, 240, 300, 310, 160, 120, 0.05, -0.01, 1e-3, -2e-3}};
  const double half = 0.2;  // both turn about y; the quaternion of cam_from_world
  records.images = {{.id = 11,
                     .camera_id = 7,
                     .quaternion_wxyz = {std::cos(half), 0, std::sin(half), 0},
                     .translation = {0.1, 0.2, 4},
                     .name = "view 10.png"},
                    {.id = 5,
                     .camera_id = 3,
                     .quaternion_wxyz = {std::cos(half), 0, -std::sin(half), 0},
                     .translation = {-0.1, 0.1, 5},
                     .name = "view 2.png"},
                    {.id = 6,
                     .camera_id = 3,
                     .quaternion_wxyz = {1, 0, 0, 0},
                     .translation = {0, 0, 1},
                     .name = "view 30.png"}};
  for (int i = 0; i < 4; ++i) {
    io::ColmapPointRecord point{.id = 100u + static_cast<std::uint64_t>(i) * 7,
                                .xyz = {0.3 * i - 0.4, 0.2 - 0.1 * i, 0.15 * i},
                                .rgb = {static_cast<std::uint8_t>(i), 128, 255},
                                .error_px = 0.5};
    for (int k = 0; k < 2; ++k) {
      auto& image = records.images[static_cast<std::size_t>(k)];
      const auto& q = image.quaternion_wxyz;
      const Eigen::Vector3d x_cv =
          Eigen::Quaterniond(q[0], q[1], q[2], q[3]) *
              Eigen::Vector3d(point.xyz[0], point.xyz[1], point.xyz[2]) +
          Eigen::Vector3d(image.translation[0], image.translation[1], image.translation[2]);
      const Eigen::Vector2d xy = *io::ImgFromCam(cameras[k], {x_cv.x(), -x_cv.y(), -x_cv.z()});
      image.features.push_back({1, 2, io::kNoPoint});
      image.features.push_back({xy.x() + 1, xy.y(), point.id});
      point.track.push_back({image.id, static_cast<std::uint32_t>(image.features.size() - 1)});
    }
    records.points.push_back(point);
  }
  return records;
}
