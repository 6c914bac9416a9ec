// Reads transforms.json in its three dialects. What every reader elsewhere guesses differently is checked
// here instead: stated size against picture, focal length against field of view, top level against frame,
// matrix against rigidity.
#include "io/scene/transforms.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <sstream>

#include "io/base/json_reader.h"
#include "io/image/image_size.h"
#include "io/scene/decomposition.h"
#include "io/scene/ply.h"
#include "io/scene/transforms_camera.h"

namespace io {
namespace {

namespace fs = std::filesystem;

constexpr double kRigid = 1e-3;            // max |R^T R - I|: beyond it the matrix is no rotation
constexpr std::size_t kMaxNamedKeys = 10;  // of those that are ignored; the others are counted
constexpr double kSinglePrecision = 1e-5;  // such noise comes from float32 and is repaired without a note
constexpr double kExact = 1e-12;           // below it the matrix is kept bit for bit

std::set<std::string> Words(const std::string& text) {
  std::istringstream words(text);
  return {std::istream_iterator<std::string>(words), {}};
}

// Cameras that we do not have: keys that say so by being there, and switches that say so when true.
const std::set<std::string> kForeignCameras = Words(
    "transform_matrix_start transform_matrix_end rolling_shutter fisheye_crop_radius "
    "ftheta_p0 ftheta_p1 ftheta_p2 ftheta_p3 ftheta_p4");
const std::set<std::string> kForeignCameraSwitches =
    Words("is_fisheye latlong equirectangular orthographic from_mitsuba");
const std::set<std::string> kIntrinsics =
    Words("w h fl_x fl_y cx cy k1 k2 k3 k4 p1 p2 x_fov y_fov distortion_params camera_model");
const std::set<std::string> kOtherRead =
    Words("frames file_path mask_path transform_matrix camera_angle_x camera_angle_y ply_file_path pipeline");
// Settings of other programs that say nothing about where a pixel looks.
const std::set<std::string> kHarmless = Words(
    "aabb_scale aabb scale offset up render_aabb envmap n_frames sharpness sharpness_discard_threshold "
    "sharpen fix_premult white_transparent black_transparent n_extra_learnable_dims integer_depth_scale "
    "enable_depth_loading depth_unit_scale_factor depth_path depth_file_path rotation colmap_im_id "
    "applied_transform applied_scale orientation_override");

struct Pose {
  Rigid3d world_from_cam;
  double deviation = 0;  // max |R^T R - I| as stored
};

class TransformsReader {
 public:
  explicit TransformsReader(const fs::path& json_path)
      : json_(JsonReader::ReadDocument(json_path)),
        root_(fs::absolute(json_path).lexically_normal().parent_path()) {}

  TransformsFile Read();

 private:
  void CheckKeys(const JsonReader& object, const std::string& place);
  TransformsDialect Dialect() const;
  // The file that a path in the JSON names, or nothing when it does not exist.
  std::optional<fs::path> Resolve(const JsonReader& value) const;
  fs::path ResolveMask(const JsonReader& value, const Camera& camera) const;
  void ReadFrame(const JsonReader& frame);
  void ReadPoints(const fs::path& path);
  void ReadPipeline(const JsonReader& ours);

  JsonReader json_;
  fs::path root_;
  TransformsFile file_;
  std::set<std::string> ignored_keys_;
  std::set<fs::path> seen_images_;
  std::vector<int> scene_index_;  // of each frame of the file; -1: its picture does not exist
  double worst_deviation_ = 0;
};

Eigen::Vector3d ReadVector(const JsonReader& json, double limit) {
  if (json.Size() != 3) json.Fail(fmt::format("has {} elements instead of 3", json.Size()));
  return {
      json.At(0).Number(-limit, limit), json.At(1).Number(-limit, limit), json.At(2).Number(-limit, limit)};
}

// The nearest rotation (polar decomposition) of a matrix that is one up to kRigid.
Eigen::Matrix3d CheckedRotation(const JsonReader& json, const Eigen::Matrix3d& matrix, double* deviation) {
  *deviation = (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(*deviation <= kRigid)) json.Fail("its 3x3 part is scaled, sheared or no rotation at all");
  if (matrix.determinant() < 0) json.Fail("its 3x3 part mirrors space (determinant -1)");
  if (*deviation <= kExact) return matrix;
  return io::NearestRotation(matrix);
}

Pose ReadPose(const JsonReader& json, TransformsDialect dialect) {
  const std::size_t rows = json.Size();
  if (rows != 4 && !(rows == 3 && dialect == TransformsDialect::kInstantNgp))
    json.Fail(fmt::format("has {} rows", rows), "Give a 4x4 camera-to-world matrix");
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (std::size_t r = 0; r < rows; ++r) {
    const JsonReader row = json.At(r);
    if (row.Size() != 4) row.Fail(fmt::format("has {} elements instead of 4", row.Size()));
    for (std::size_t c = 0; c < 4; ++c)
      matrix(static_cast<int>(r), static_cast<int>(c)) = row.At(c).Number(-kMaxCoordinate, kMaxCoordinate);
  }
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) json.Fail("its last row is not 0 0 0 1");
  Pose pose;
  pose.world_from_cam.rotation = CheckedRotation(json, matrix.topLeftCorner<3, 3>(), &pose.deviation);
  pose.world_from_cam.translation = matrix.topRightCorner<3, 1>();
  return pose;
}

void TransformsReader::CheckKeys(const JsonReader& object, const std::string& place) {
  for (const std::string& key : object.Keys()) {
    const JsonReader value = object.At(key);
    if (kForeignCameras.contains(key) || (kForeignCameraSwitches.contains(key) && value.Bool())) {
      value.Fail("this camera is not supported", "Undistort first: pictures must be perspective");
    } else if (key.ends_with("_filenames")) {
      ignored_keys_.insert(key + " (the split is made anew)");
    } else if (!kForeignCameraSwitches.contains(key) && !kIntrinsics.contains(key) &&
               !kOtherRead.contains(key) && !kHarmless.contains(key)) {
      ignored_keys_.insert(place + key + " (unknown)");
    }
  }
}

TransformsDialect TransformsReader::Dialect() const {
  for (const char* key : {"camera_model", "applied_transform", "ply_file_path", "orientation_override"}) {
    if (json_.Has(key)) return TransformsDialect::kNerfstudio;
  }
  for (const char* key :
       {"aabb_scale", "aabb", "scale", "offset", "is_fisheye", "n_frames", "camera_angle_y"}) {
    if (json_.Has(key)) return TransformsDialect::kInstantNgp;
  }
  const JsonReader frame = json_.At("frames").At(0);
  for (const std::string& key : kIntrinsics) {
    if (json_.Has(key) || frame.Has(key)) return TransformsDialect::kInstantNgp;
  }
  return json_.Has("camera_angle_x") ? TransformsDialect::kBlender : TransformsDialect::kInstantNgp;
}

std::optional<fs::path> TransformsReader::Resolve(const JsonReader& value) const {
  std::string text = value.String();
  std::replace(text.begin(), text.end(), '\\', '/');
  const bool has_control = std::any_of(text.begin(), text.end(), [](char c) { return c >= 0 && c < ' '; });
  const bool has_drive = text.size() > 1 && text[1] == ':';
  if (text.empty() || has_control || has_drive || text.find("://") != std::string::npos || text[0] == '/')
    value.Fail("is not a relative path", "Name pictures relative to the JSON file");
  const fs::path relative = fs::path(text).lexically_normal();
  std::vector<fs::path> candidates = {relative};
  if (!relative.has_extension())
    candidates = {relative.string() + ".png", relative.string() + ".jpg", relative};
  for (const fs::path& candidate : candidates) {
    std::error_code error;
    const fs::path real = fs::weakly_canonical(root_ / candidate, error);
    const fs::path below = error ? fs::path() : real.lexically_relative(fs::weakly_canonical(root_));
    if (below.empty() || *below.begin() == "..")
      value.Fail("\"" + text + "\" leaves the folder of the JSON file", "Copy the pictures beside it");
    if (fs::is_regular_file(real, error)) return root_ / candidate;
    if (fs::exists(real, error) && !fs::is_directory(real, error)) value.Fail("is not a regular file");
  }
  return std::nullopt;
}

void TransformsReader::ReadFrame(const JsonReader& frame) {
  CheckKeys(frame, "frames[].");
  const Pose pose = ReadPose(frame.At("transform_matrix"), file_.dialect);
  worst_deviation_ = std::max(worst_deviation_, pose.deviation);
  const JsonReader file_path = frame.At("file_path");
  const std::optional<fs::path> image_path = Resolve(file_path);
  if (!image_path) {
    file_.missing_images.push_back(file_path.String());
    scene_index_.push_back(-1);
    return;
  }
  if (!seen_images_.insert(fs::canonical(*image_path)).second)
    file_path.Fail("\"" + file_path.String() + "\" is posed twice", "Keep one frame per picture");
  const Camera camera = ReadTransformsCamera(json_, frame, *image_path);
  std::vector<Camera>& cameras = file_.scene.cameras;
  const auto found = std::find(cameras.begin(), cameras.end(), camera);
  const int index = static_cast<int>(found - cameras.begin());
  if (found == cameras.end()) cameras.push_back(camera);
  fs::path mask_path;
  if (frame.Has("mask_path")) mask_path = ResolveMask(frame.At("mask_path"), camera);
  scene_index_.push_back(static_cast<int>(file_.scene.frames.size()));
  file_.scene.frames.push_back({*image_path, index, pose.world_from_cam, mask_path});
}

void TransformsReader::ReadPoints(const fs::path& path) {
  std::vector<Point3D>& points = file_.scene.points;
  points = ReadPly(path);
  const int n_frames = static_cast<int>(scene_index_.size());
  for (const Point3D& point : points) {
    for (const int frame : point.frame_indices) {
      if (frame >= n_frames)
        json_.At("ply_file_path")
            .Fail(fmt::format("its points are observed by frame {}, but there are {}", frame, n_frames));
    }
  }
  RenumberObservers(scene_index_, &points);
}

fs::path TransformsReader::ResolveMask(const JsonReader& value, const Camera& camera) const {
  const std::optional<fs::path> path = Resolve(value);
  if (!path)
    value.Fail("\"" + value.String() + "\" does not exist", "Put it beside the JSON file or remove the key");
  const ImageSize size = ReadImageSize(*path);
  if (size.width != camera.width || size.height != camera.height)
    value.Fail("\"" + value.String() + "\" differs in size from its picture", "Make the mask anew");
  return *path;
}

void TransformsReader::ReadPipeline(const JsonReader& ours) {
  Scene& scene = file_.scene;
  constexpr double kMinScale = 1e-12;  // a positive number whose inverse is finite
  scene.near = ours.At("near").Number(0, kMaxCoordinate);
  scene.far = ours.At("far").Number(0, kMaxCoordinate);
  if (!(scene.near < scene.far)) ours.Fail("near is not smaller than far");
  const JsonReader aabb = ours.At("aabb");
  scene.aabb = {ReadVector(aabb.At(0), kMaxCoordinate), ReadVector(aabb.At(1), kMaxCoordinate)};
  if (!(scene.aabb.min.array() < scene.aabb.max.array()).all()) aabb.Fail("has no volume");
  scene.unbounded = ours.At("unbounded").Bool();
  const JsonReader sim3 = ours.At("scene_from_sfm");
  scene.scene_from_sfm.scale = sim3.At("scale").Number(kMinScale, 1 / kMinScale);
  scene.scene_from_sfm.translation = ReadVector(sim3.At("translation"), kMaxCoordinate);
  const JsonReader rows = sim3.At("rotation");
  Eigen::Matrix3d rotation;
  for (int r = 0; r < 3; ++r) rotation.row(r) = ReadVector(rows.At(static_cast<std::size_t>(r)), 2);
  double deviation = 0;
  scene.scene_from_sfm.rotation = CheckedRotation(rows, rotation, &deviation);
  file_.has_near_far = true;
}

TransformsFile TransformsReader::Read() {
  const JsonReader frames = json_.At("frames");
  if (frames.Size() == 0) frames.Fail("is empty");
  file_.dialect = Dialect();
  CheckKeys(json_, "");
  for (std::size_t i = 0; i < frames.Size(); ++i) ReadFrame(frames.At(i));
  if (!file_.missing_images.empty() && file_.scene.frames.size() < 2) {
    json_.Fail(fmt::format("{} of {} pictures do not exist, first {}",
                           file_.missing_images.size(),
                           frames.Size(),
                           file_.missing_images[0]),
               "Put them beside the JSON file");
  }
  if (json_.Has("ply_file_path")) {
    const std::optional<fs::path> ply = Resolve(json_.At("ply_file_path"));
    if (!ply)
      json_.At("ply_file_path").Fail("does not exist", "Put it beside the JSON file or remove the key");
    ReadPoints(*ply);
  }
  if (json_.Has("pipeline")) ReadPipeline(json_.At("pipeline"));
  std::size_t n_named = 0;
  for (const std::string& key : ignored_keys_) {
    if (++n_named > kMaxNamedKeys) break;
    file_.notes.push_back("ignored " + key);
  }
  if (ignored_keys_.size() > kMaxNamedKeys)
    file_.notes.push_back(fmt::format("ignored {} more keys", ignored_keys_.size() - kMaxNamedKeys));
  if (worst_deviation_ > kSinglePrecision)
    file_.notes.push_back(
        fmt::format("rotations deviated from orthonormal by up to {:f} and were replaced by the nearest ones",
                    worst_deviation_));
  return std::move(file_);
}

}  // namespace

TransformsFile ReadTransforms(const fs::path& json_path) { return TransformsReader(json_path).Read(); }

}  // namespace io
