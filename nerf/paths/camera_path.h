// The path of the film's camera, fitted to where the photographs were taken, so that the film shows what was
// observed. Its kind follows from the cameras' places and optical axes alone:
//
//   orbit   The axes meet at a subject and the cameras stand all around it.
//   arc     They meet, but a side was not photographed: to and fro inside the covered arc, as far as the
//           subject fits the picture.
//   sway    The axes do not meet and the cameras stand close together, side by side: an ellipse among them.
//   walk    All else, such as a room or a street, and cameras that go where they look: along
//           the cameras, in the order of the capture.
//
// Of the views of a panorama the first is followed.
// Every kind averages the places of neighbouring cameras, hence stays inside their hull, and looks where they
// looked. free_path.h then compares the path with the trained field, and even_path.h times it.
#pragma once

#include <string>
#include <vector>

#include "nerf/data/capture_geometry.h"

namespace nerf {

enum class PathKind { kOrbit, kArc, kSway, kWalk };

struct CameraPath {
  PathKind kind = PathKind::kOrbit;
  std::vector<io::Rigid3d> world_from_cam;  // OpenGL axes
  std::vector<double> depths;  // of each pose, how far away what it shows is; empty: not looked at
  CaptureGeometry capture;
  double arc_deg = 0;   // of an orbit or an arc: azimuth that the path covers
  double distance = 0;  // mean distance from the focus
  // The last pose precedes the first: all kinds but a walk, which has an end.
  bool IsLoop() const { return kind != PathKind::kWalk; }
};

// Throws kBadInput for a scene without frames or with cameras in one place. frames: at least 2.
CameraPath FitCameraPath(const io::Scene& scene, int frames);

// What the camera moves in all, see Motion().
double TotalMotion(const CameraPath& path);
// The largest motion from a pose of the path to the nearest training camera.
double LargestDeparture(const CameraPath& path, const io::Scene& scene);

// Which kind it is, and why.
std::string Describe(const CameraPath& path);

}  // namespace nerf
