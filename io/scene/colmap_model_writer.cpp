// Writes a COLMAP sparse model as text. Layout: https://colmap.github.io/format.html#text-format.
#include <fmt/format.h>

#include <charconv>

#include "io/base/atomic_file.h"
#include "io/scene/colmap_model.h"

namespace io {
namespace {

// Enough to restore every double.
constexpr int kDigits = 17;

void Append(std::string* text, double value) {
  char buffer[32];
  const auto end =
      std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general, kDigits).ptr;
  text->append(buffer, end);
}

void AppendCount(std::string* text, std::size_t value) {
  *text += ' ';
  *text += std::to_string(value);
}

void AppendAll(std::string* text, std::initializer_list<double> values) {
  for (const double value : values) {
    *text += ' ';
    Append(text, value);
  }
}

// " WIDTH HEIGHT PARAMS..." behind the name of the simplest model that loses nothing.
std::string CameraLine(const Camera& c) {
  std::string sizes;
  AppendCount(&sizes, static_cast<std::size_t>(c.width));
  AppendCount(&sizes, static_cast<std::size_t>(c.height));
  const bool one_focal = c.fl_x == c.fl_y, tangential = c.p1 != 0 || c.p2 != 0;
  if (tangential || (!one_focal && c.HasDistortion())) {
    AppendAll(&sizes, {c.fl_x, c.fl_y, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2});
    return "OPENCV" + sizes;
  }
  if (!one_focal) {
    AppendAll(&sizes, {c.fl_x, c.fl_y, c.cx, c.cy});
    return "PINHOLE" + sizes;
  }
  AppendAll(&sizes, {c.fl_x, c.cx, c.cy});
  if (c.k2 != 0) {
    AppendAll(&sizes, {c.k1, c.k2});
    return "RADIAL" + sizes;
  }
  if (c.k1 == 0) return "SIMPLE_PINHOLE" + sizes;
  AppendAll(&sizes, {c.k1});
  return "SIMPLE_RADIAL" + sizes;
}

std::string PoseText(const Frame& frame) {
  const Rigid3d cam_from_world = FlipCameraAxes(frame.world_from_cam).Inverse();
  const Eigen::Quaterniond q(cam_from_world.rotation);
  const Eigen::Vector3d& t = cam_from_world.translation;
  std::string text;
  AppendAll(&text, {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()});
  return text;
}

}  // namespace

void WriteColmapModel(const std::filesystem::path& folder, const ColmapModel& model) {
  std::string cameras, images, points;
  for (std::size_t i = 0; i < model.scene.cameras.size(); ++i) {
    cameras += fmt::format("{} {}\n", i + 1, CameraLine(model.scene.cameras[i]));
  }
  // Feature k of a picture is its k-th observation.
  std::vector<std::string> features(model.scene.frames.size()), tracks(model.scene.points.size());
  std::vector<std::size_t> n_features(model.scene.frames.size());
  for (const Observation& observation : model.observations) {
    const auto frame = static_cast<std::size_t>(observation.frame_index);
    const auto point = static_cast<std::size_t>(observation.point_index);
    AppendAll(&features[frame], {observation.xy.x(), observation.xy.y()});
    AppendCount(&features[frame], point + 1);
    AppendCount(&tracks[point], frame + 1);
    AppendCount(&tracks[point], n_features[frame]++);
  }
  for (std::size_t i = 0; i < model.scene.frames.size(); ++i) {
    const Frame& frame = model.scene.frames[i];
    images += fmt::format("{}{} {} {}\n{}\n",
                          i + 1,
                          PoseText(frame),
                          frame.camera_index + 1,
                          frame.image_path.string(),
                          features[i]);
  }
  for (std::size_t i = 0; i < model.scene.points.size(); ++i) {
    const Point3D& point = model.scene.points[i];
    points += std::to_string(i + 1);
    AppendAll(&points, {point.xyz.x(), point.xyz.y(), point.xyz.z()});
    for (const std::uint8_t value : point.rgb) AppendCount(&points, value);
    AppendAll(&points, {point.error_px});
    points += tracks[i] + "\n";
  }
  WriteFileAtomically(folder / "cameras.txt", cameras);
  WriteFileAtomically(folder / "images.txt", images);
  WriteFileAtomically(folder / "points3D.txt", points);
}

}  // namespace io
