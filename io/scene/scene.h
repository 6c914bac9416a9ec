// `Scene` is the contract between the layers: what structure-from-motion delivers and what a radiance field
// is trained on.
//
// Conventions, stated here once and checked by tests/io/scene/scene_test.cpp:
//   * Pixel (0, 0) has its centre at (0.5, 0.5); the picture spans [0, width] x [0, height].
//   * Poses are world_from_cam with OpenGL camera axes: x right, y up, z back (the camera looks along -z).
//   * Geometry is in double.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/scene/pose.h"

namespace io {

// Of cameras and points in files: double keeps 1e-7 units there, and squares stay far from overflow.
inline constexpr double kMaxCoordinate = 1e9;

// Pinhole camera with OpenCV's radial-tangential distortion. Focal lengths and principal point in pixels.
struct Camera {
  int width = 0, height = 0;
  double fl_x = 0, fl_y = 0, cx = 0, cy = 0;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;

  bool HasDistortion() const { return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0; }
  bool operator==(const Camera&) const = default;
};

// What no lens and no crop of its pictures has, for a message; empty when the camera is plausible. Focal
// lengths: 0.1 to 30 of the longer side; beyond, pictures span less than two degrees, and their rays hardly
// differ. The principal point lies inside the picture: one on its edge, or outside, was never set or belongs
// to another size.
std::string ImplausibleIntrinsics(const Camera& camera);

struct Frame {
  std::filesystem::path image_path;  // absolute, or relative to the file that the scene was read from
  int camera_index = 0;              // into Scene::cameras
  Rigid3d world_from_cam;            // OpenGL axes
  std::filesystem::path mask_path;   // as image_path; its pixels that count (io/image/mask.h); empty: all do
};

struct Point3D {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  std::array<std::uint8_t, 3> rgb = {0, 0, 0};
  double error_px = 0;             // mean reprojection error; 0 when unknown
  std::vector<int> frame_indices;  // frames that observe the point; empty when unknown
};

struct Aabb {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();
};

struct Scene {
  std::vector<Camera> cameras;
  std::vector<Frame> frames;
  std::vector<Point3D> points;
  Sim3d scene_from_sfm;  // how the original world was moved and scaled; identity until normalised
  double near = 2.0, far = 6.0;
  Aabb aabb;               // region of interest in scene units
  bool unbounded = false;  // pictures show things beyond far and aabb: space outside is to be contracted
};

// Gives the frames that observe the points their new indices, -1 for frames that are left out. Points that
// lose all their observers go: without one a point would count as one whose observers are unknown.
void RenumberObservers(const std::vector<int>& new_index, std::vector<Point3D>* points);

// Projects a point given in the camera's OpenGL axes to pixels; nothing when it is not in front of the
// camera.
std::optional<Eigen::Vector2d> ImgFromCam(const Camera& camera, const Eigen::Vector3d& x_in_cam);

// Unit direction, in OpenGL camera axes, of the ray through pixel coordinates (x, y); nothing where the
// distortion cannot be inverted.
std::optional<Eigen::Vector3d> RayFromImg(const Camera& camera, const Eigen::Vector2d& xy);

// The same camera for pictures resized to width x height pixels.
Camera ResizedCamera(const Camera& camera, int width, int height);

}  // namespace io
