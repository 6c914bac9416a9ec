#include "pipeline/export/target_frame.h"

#include <charconv>
#include <cmath>

#include "io/base/error.h"
#include "io/scene/scene.h"

namespace pipeline {

PointsApart ParsePointsApart(const std::string& option_name, const std::string& text) {
  const auto refuse = [&](const std::string& why) {
    throw io::Error(io::ExitCode::kUsage,
                    "--" + option_name + ": '" + text + "' " + why,
                    "Give two points and their distance in metres, as in 0,0,0,1,0,0=0.30");
  };
  double values[7] = {};
  const char *at = text.data(), *const end = at + text.size();
  for (int i = 0; i < 7; ++i) {
    const auto [stop, error] = std::from_chars(at, end, values[i]);
    const char separator = i < 5 ? ',' : '=';
    const bool ends_well = i == 6 ? stop == end : stop != end && *stop == separator;
    if (error != std::errc() || !ends_well) refuse("has another form");
    if (!(std::abs(values[i]) <= io::kMaxCoordinate)) refuse("has a number out of range");
    at = stop + 1;
  }
  const PointsApart apart{{values[0], values[1], values[2]}, {values[3], values[4], values[5]}, values[6]};
  if ((apart.a - apart.b).norm() == 0) refuse("names one point twice");
  if (apart.metres <= 0) refuse("has a distance that is not positive");
  return apart;
}

TargetFrame MakeTargetFrame(const FrameOptions& options, const io::Sim3d& scene_from_sfm) {
  TargetFrame target;
  if (options.frame == "sfm") {
    target = {.name = "sfm", .unit = "unit of sfm", .target_from_scene = scene_from_sfm.Inverse()};
  }
  if (options.points_apart.empty()) return target;
  const PointsApart apart = ParsePointsApart("points-apart", options.points_apart);
  io::Sim3d metres_from_frame;
  metres_from_frame.scale = apart.metres / (apart.a - apart.b).norm();
  target.unit = "metre";
  target.target_from_scene = metres_from_frame * target.target_from_scene;
  return target;
}

}  // namespace pipeline
