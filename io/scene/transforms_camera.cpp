#include "io/scene/transforms_camera.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "io/image/image_size.h"

namespace io {
namespace {

constexpr double kMaxPixels = 65535;    // as ReadImageSize
constexpr double kMaxFocal = 1e7;       // pixels; ImplausibleIntrinsics tells the rest
constexpr double kMaxDistortion = 100;  // the k2 of a strong lens is below 10
// Relative; a rounded angle differs by 1e-6, another camera by percents.
constexpr double kFocalAgreement = 1e-3;
constexpr double kSameNumber = 1e-9;  // relative; the same value printed by two programs

// A number stated on the top level, in the frame, or alike in both.
std::optional<double> Stated(
    const JsonReader& top, const JsonReader& frame, const std::string& key, double min, double max) {
  std::optional<double> shared, own;
  if (top.Has(key)) shared = top.At(key).Number(min, max);
  if (frame.Has(key)) own = frame.At(key).Number(min, max);
  if (shared && own && std::abs(*shared - *own) > kSameNumber * std::abs(*shared))
    frame.At(key).Fail("contradicts the value on the top level", "Keep one of the two");
  return own ? own : shared;
}

void CheckCameraModel(const JsonReader& top, const JsonReader& frame) {
  static const std::set<std::string> kPerspective = {
      "OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "PERSPECTIVE"};
  for (const JsonReader& scope : {top, frame}) {
    if (!scope.Has("camera_model")) continue;
    const JsonReader model = scope.At("camera_model");
    if (!kPerspective.contains(model.String()))
      model.Fail("\"" + model.String() + "\" is not supported",
                 "Undistort first: pictures must be perspective");
  }
}

// Every statement about the focal length (pixels, radians, degrees) must agree with the others.
std::optional<double> FocalLength(const JsonReader& top, const JsonReader& frame, char axis, int pixels) {
  constexpr double kPi = std::numbers::pi;
  const std::string fl = std::string("fl_") + axis, fov = std::string(1, axis) + "_fov",
                    angle = std::string("camera_angle_") + axis;
  // Angles of 0 and 180 degrees have no focal length; the bounds keep the tangent finite.
  constexpr double kMinAngle = 1e-6, kMaxAngle = kPi - 1e-3;
  std::optional<double> focal = Stated(top, frame, fl, 1, kMaxFocal);
  const auto agree = [&](std::optional<double> radians, const std::string& key) {
    if (!radians) return;
    const double other = 0.5 * pixels / std::tan(0.5 * *radians);
    if (focal && std::abs(other - *focal) > kFocalAgreement * *focal)
      frame.Fail("its focal length contradicts " + key, "Remove the wrong one");
    if (!focal) focal = other;
  };
  std::optional<double> degrees = Stated(top, frame, fov, kMinAngle * 180 / kPi, kMaxAngle * 180 / kPi);
  if (degrees) *degrees *= kPi / 180;
  agree(degrees, fov);
  agree(Stated(top, frame, angle, kMinAngle, kMaxAngle), angle);
  return focal;
}

}  // namespace

Camera ReadTransformsCamera(const JsonReader& top,
                            const JsonReader& frame,
                            const std::filesystem::path& image_path) {
  CheckCameraModel(top, frame);
  const ImageSize size = ReadImageSize(image_path);
  const auto check_side = [&](const char* key, int pixels) {
    const std::optional<double> stated = Stated(top, frame, key, 1, kMaxPixels);
    const JsonReader scope = frame.Has(key) ? frame : top;
    if (stated && scope.At(key).Integer(1, static_cast<int>(kMaxPixels)) != pixels)
      scope.At(key).Fail(fmt::format("differs from {}, which has {}", image_path.filename().string(), pixels),
                         "Correct the size or use the pictures that it belongs to");
  };
  check_side("w", size.width);
  check_side("h", size.height);

  Camera camera{.width = size.width, .height = size.height};
  const std::optional<double> fl_x = FocalLength(top, frame, 'x', size.width),
                              fl_y = FocalLength(top, frame, 'y', size.height);
  if (!fl_x && !fl_y) frame.Fail("states no fl_x, fl_y or camera_angle_x, nor does the top level");
  camera.fl_x = fl_x ? *fl_x : *fl_y;
  camera.fl_y = fl_y ? *fl_y : *fl_x;
  camera.cx = Stated(top, frame, "cx", -kMaxPixels, kMaxPixels).value_or(0.5 * size.width);
  camera.cy = Stated(top, frame, "cy", -kMaxPixels, kMaxPixels).value_or(0.5 * size.height);
  if (const std::string fault = ImplausibleIntrinsics(camera); !fault.empty())
    frame.Fail("states " + fault, "Correct the camera");
  const auto distortion = [&](const char* key) {
    return Stated(top, frame, key, -kMaxDistortion, kMaxDistortion).value_or(0);
  };
  camera.k1 = distortion("k1");
  camera.k2 = distortion("k2");
  camera.p1 = distortion("p1");
  camera.p2 = distortion("p2");
  bool is_higher_order = distortion("k3") != 0 || distortion("k4") != 0;
  for (const JsonReader& scope : {top, frame}) {
    if (!scope.Has("distortion_params")) continue;
    const JsonReader values = scope.At("distortion_params");
    for (std::size_t i = 0; i < values.Size(); ++i)
      is_higher_order |= values.At(i).Number(-kMaxDistortion, kMaxDistortion) != 0;
  }
  if (is_higher_order)
    frame.Fail("has k3, k4 or distortion_params that are not zero",
               "Undistort first, or state k1, k2, p1, p2");
  return camera;
}

}  // namespace io
