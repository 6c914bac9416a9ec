// Verifies what io/scene/colmap_records.h parsed and turns it into a Scene.
#include "io/scene/colmap_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <unordered_map>

#include "io/base/error.h"
#include "io/base/natural_order.h"
#include "io/base/quoting.h"
#include "io/scene/colmap_records.h"

namespace io {
namespace {

namespace fs = std::filesystem;

// Text files written with six digits are off by less than this; a damaged quaternion is off by more.
constexpr double kUnitQuaternionTolerance = 1e-3;
// Larger pictures do not exist; a damaged size would overflow int.
constexpr std::uint64_t kMaxImageSide = 1 << 20;

bool AllFinite(const auto& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

Camera ToCamera(const fs::path& path, const ColmapCameraRecord& record) {
  const std::string label = fmt::format("camera {}", record.id);
  const int n_params = ColmapParamCount(record.model);
  if (n_params < 0)
    RefuseModel(path, label + " has the undefined model '" + record.model.substr(0, 40) + "'");
  if (static_cast<int>(record.params.size()) != n_params) {
    RefuseModel(
        path,
        fmt::format(
            "{} has {} parameters, {} needs {}", label, record.params.size(), record.model, n_params));
  }
  if (record.width == 0 || record.height == 0 || record.width > kMaxImageSide ||
      record.height > kMaxImageSide) {
    RefuseModel(path, fmt::format("{} has the size {}x{}", label, record.width, record.height));
  }
  if (!AllFinite(record.params)) RefuseModel(path, label + " has a parameter that is not finite");
  Camera camera{.width = static_cast<int>(record.width), .height = static_cast<int>(record.height)};
  const auto& p = record.params;
  const auto set_shared_focal = [&] { camera.fl_x = camera.fl_y = p[0], camera.cx = p[1], camera.cy = p[2]; };
  const auto set_two_focals = [&] {
    camera.fl_x = p[0], camera.fl_y = p[1], camera.cx = p[2], camera.cy = p[3];
  };
  if (record.model == "SIMPLE_PINHOLE") {
    set_shared_focal();
  } else if (record.model == "PINHOLE") {
    set_two_focals();
  } else if (record.model == "SIMPLE_RADIAL") {
    set_shared_focal();
    camera.k1 = p[3];
  } else if (record.model == "RADIAL") {
    set_shared_focal();
    camera.k1 = p[3], camera.k2 = p[4];
  } else if (record.model == "OPENCV") {
    set_two_focals();
    camera.k1 = p[4], camera.k2 = p[5], camera.p1 = p[6], camera.p2 = p[7];
  } else {
    throw Error(ExitCode::kBadInput,
                path.string() + ": " + label + " has the model " + record.model + ", which is not supported",
                "Undistort first (colmap image_undistorter)");
  }
  if (const std::string fault = ImplausibleIntrinsics(camera); !fault.empty())
    RefuseModel(path, label + " has " + fault);
  return camera;
}

// Within kMaxCoordinate along every axis.
bool IsNear(const std::array<double, 3>& xyz) {
  return std::all_of(xyz.begin(), xyz.end(), [](double x) { return std::abs(x) <= kMaxCoordinate; });
}

// Names are joined to folders and written to JSON later: relative, staying inside, one line of UTF-8.
bool IsSafeName(const std::string& name) {
  const bool is_plain_text = name.find('\n') == std::string::npos && Printable(name) == name;
  const fs::path path(name);
  return !name.empty() && is_plain_text && path.is_relative() &&
         std::none_of(path.begin(), path.end(), [](const fs::path& part) { return part == ".."; });
}

Rigid3d ToWorldFromCam(const fs::path& path, const ColmapImageRecord& record) {
  const std::string label = fmt::format("image {}", record.id);
  const auto& q = record.quaternion_wxyz;
  if (!AllFinite(q) || !AllFinite(record.translation))
    RefuseModel(path, label + " has a pose that is not finite");
  if (!IsNear(record.translation)) RefuseModel(path, label + " lies more than 1e9 from the origin");
  const Eigen::Quaterniond quaternion(q[0], q[1], q[2], q[3]);
  if (!(std::abs(quaternion.norm() - 1.0) < kUnitQuaternionTolerance)) {
    RefuseModel(path, label + " has a quaternion that is not of unit length");
  }
  const Rigid3d cam_from_world{quaternion.normalized().toRotationMatrix(),
                               {record.translation[0], record.translation[1], record.translation[2]}};
  return FlipCameraAxes(cam_from_world.Inverse());
}

double Ratio(double sum, std::size_t n) { return n == 0 ? 0.0 : sum / static_cast<double>(n); }

// Of the observations whose point lies in front of the camera.
double MeanErrorPx(const ColmapModel& model) {
  double sum = 0;
  std::size_t n = 0;
  for (const Observation& observation : model.observations) {
    const auto projected = Project(model.scene, observation);
    if (!projected) continue;
    sum += (*projected - observation.xy).norm();
    ++n;
  }
  return Ratio(sum, n);
}

class ModelBuilder {
 public:
  explicit ModelBuilder(const ColmapRecords& records) : records_(records) {}

  ColmapModel Build() {
    AddCameras();
    AddImages();
    AddPoints();
    CheckFeatureReferences();
    model_.mean_track_length = Ratio(static_cast<double>(model_.observations.size()), records_.points.size());
    model_.mean_reprojection_error_px = MeanErrorPx(model_);
    return std::move(model_);
  }

 private:
  void AddCameras() {
    for (const ColmapCameraRecord& record : records_.cameras) {
      const int index = static_cast<int>(model_.scene.cameras.size());
      if (!camera_index_.emplace(record.id, index).second) {
        RefuseModel(records_.cameras_path, fmt::format("camera {} appears twice", record.id));
      }
      model_.scene.cameras.push_back(ToCamera(records_.cameras_path, record));
    }
    if (!records_.cameras.empty()) model_.camera_model = records_.cameras.front().model;
  }

  void AddImages() {
    std::vector<std::size_t> order(records_.images.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return NaturalLess(records_.images[a].name, records_.images[b].name);
    });
    std::set<std::string> names;
    for (const std::size_t i : order) {
      const ColmapImageRecord& record = records_.images[i];
      const std::string label = fmt::format("image {}", record.id);
      if (!IsSafeName(record.name))
        RefuseModel(records_.images_path, label + " has an empty or unsafe name '" + record.name + "'");
      if (!names.insert(record.name).second) {
        RefuseModel(records_.images_path, label + ": the name '" + record.name + "' appears twice");
      }
      const auto camera = camera_index_.find(record.camera_id);
      if (camera == camera_index_.end()) {
        RefuseModel(records_.images_path,
                    fmt::format("{} refers to the missing camera {}", label, record.camera_id));
      }
      const int index = static_cast<int>(model_.scene.frames.size());
      if (!image_index_.emplace(record.id, Image{index, &record}).second) {
        RefuseModel(records_.images_path, label + " appears twice");
      }
      model_.scene.frames.push_back(
          {record.name, camera->second, ToWorldFromCam(records_.images_path, record)});
    }
  }

  void AddPoints() {
    std::set<std::uint64_t> ids;
    for (const ColmapPointRecord& record : records_.points) {
      const std::string label = fmt::format("point {}", record.id);
      if (!ids.insert(record.id).second) RefuseModel(records_.points_path, label + " appears twice");
      if (!AllFinite(record.xyz) || !std::isfinite(record.error_px)) {
        RefuseModel(records_.points_path, label + " is not finite");
      }
      if (!IsNear(record.xyz))
        RefuseModel(records_.points_path, label + " lies more than 1e9 from the origin");
      Point3D point{.xyz = {record.xyz[0], record.xyz[1], record.xyz[2]},
                    .rgb = record.rgb,
                    .error_px = std::max(0.0, record.error_px)};  // COLMAP writes -1 for unknown
      for (const ColmapTrackElement& element : record.track) AddObservation(record, element, &point);
      model_.scene.points.push_back(std::move(point));
    }
  }

  void AddObservation(const ColmapPointRecord& record, const ColmapTrackElement& element, Point3D* point) {
    const std::string label = fmt::format("point {}", record.id);
    const auto image = image_index_.find(element.image_id);
    if (image == image_index_.end()) {
      RefuseModel(records_.points_path,
                  fmt::format("{} refers to the missing image {}", label, element.image_id));
    }
    const auto& features = image->second.record->features;
    if (element.feature_index >= features.size() || features[element.feature_index].point_id != record.id) {
      RefuseModel(records_.points_path,
                  fmt::format("{} refers to feature {} of image {}, which does not refer back",
                              label,
                              element.feature_index,
                              element.image_id));
    }
    const ColmapFeatureRecord& feature = features[element.feature_index];
    if (!std::isfinite(feature.x) || !std::isfinite(feature.y)) {
      RefuseModel(records_.images_path,
                  fmt::format("image {} has a feature that is not finite", element.image_id));
    }
    point->frame_indices.push_back(image->second.frame_index);
    model_.observations.push_back(
        {image->second.frame_index, static_cast<int>(model_.scene.points.size()), {feature.x, feature.y}});
  }

  // Every track element points to a feature that points back; equal counts make it one to one.
  void CheckFeatureReferences() const {
    std::size_t n_references = 0;
    for (const ColmapImageRecord& record : records_.images) {
      n_references += static_cast<std::size_t>(std::count_if(
          record.features.begin(), record.features.end(), [](const ColmapFeatureRecord& feature) {
            return feature.point_id != kNoPoint;
          }));
    }
    if (n_references != model_.observations.size()) {
      RefuseModel(records_.images_path,
                  fmt::format("refers to points {} times, but {} holds {} track elements",
                              n_references,
                              records_.points_path.filename().string(),
                              model_.observations.size()));
    }
  }

  struct Image {
    int frame_index;
    const ColmapImageRecord* record;
  };
  const ColmapRecords& records_;
  ColmapModel model_;
  std::unordered_map<std::uint32_t, int> camera_index_;
  std::unordered_map<std::uint32_t, Image> image_index_;
};

}  // namespace

std::optional<Eigen::Vector2d> Project(const Scene& scene, const Observation& observation) {
  const Frame& frame = scene.frames[static_cast<std::size_t>(observation.frame_index)];
  return ImgFromCam(
      scene.cameras[static_cast<std::size_t>(frame.camera_index)],
      frame.world_from_cam.Inverse() * scene.points[static_cast<std::size_t>(observation.point_index)].xyz);
}

bool IsColmapModel(const fs::path& folder) {
  const auto holds_all = [&](const std::string& extension) {
    return fs::is_regular_file(folder / ("cameras" + extension)) &&
           fs::is_regular_file(folder / ("images" + extension)) &&
           fs::is_regular_file(folder / ("points3D" + extension));
  };
  return holds_all(".bin") || holds_all(".txt");
}

ColmapModel ReadColmapModel(const fs::path& folder) {
  const ColmapRecords records = ReadColmapRecords(folder);
  return ModelBuilder(records).Build();
}

}  // namespace io
