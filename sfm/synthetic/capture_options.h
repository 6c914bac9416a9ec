// What a generated capture looks like: where the camera goes, what it sees, and what goes wrong.
#pragma once

#include <cstdint>
#include <vector>

#include "io/scene/scene.h"

namespace sfm {

// The subject has about radius 1 around the origin; y is up. Cameras stand at the distance at which it fills
// four fifths of the picture, and all but kLine are shaken as a hand shakes them.
enum class Trajectory {
  kRing,          // around the subject, evenly
  kArc,           // part of a ring
  kLine,          // along x, all axes parallel: exactly collinear centres
  kForward,       // towards the subject, along the viewing axis
  kRotationOnly,  // on one spot
  kTwoClusters,   // two arcs 60 degrees apart
  kSpiral,        // two turns from below to above
  kNadirGrid,     // lanes of a drone that looks straight at a plane
};

// Points are seen from every side unless said otherwise.
enum class Structure {
  kBall,
  kPlane,           // z = 0
  kTwoPlanes,       // meeting at a right angle
  kLine,            // the x axis
  kCorridor,        // the four walls around the viewing axis
  kIdenticalSides,  // an opaque box with the same relief on its four sides
  kTwoFacades,      // the same, but only front and back are alike
  kTiledFloor,      // kPlane of equal tiles
  kField,           // the plane, filled evenly as far as the cameras go
};

enum class Outliers {
  kUniform,        // matches between unrelated points
  kSecondMotion,   // matches on a second rigid body
  kStaticOverlay,  // matches that stay where they are in the picture
};

enum class MatchGraph {
  kFull,    // all pairs
  kChain,   // each picture with the `chain_overlap` that follow it
  kSparse,  // following pictures, and three tenths of the other pairs
};

struct CaptureOptions {
  Trajectory trajectory = Trajectory::kRing;
  Structure structure = Structure::kBall;
  // kPlane, kTiledFloor, kField: largest height of a point above the plane, over the cameras' distance.
  double relief = 0;
  int pictures = 14, points = 300;
  double baseline = 0.1;  // between following pictures, over the distance; kRing and kSpiral have their own
  double rotation_only_share = 0;  // of following pairs: the later picture is taken from the same spot
  int duplicates = 0;              // further pictures in front, with the pose of the first
  double far_share = 0;            // of the points: at ten thousand times the cameras' distance

  // The pictures take them in turn.
  std::vector<io::Camera> cameras = {
      {.width = 1024, .height = 768, .fl_x = 1280, .fl_y = 1280, .cx = 512, .cy = 384}};
  double focal_guess = 1;          // Picture::focal_px over the true focal length; 0: unknown
  double rolling_shutter_deg = 0;  // how far the camera turns, about any axis, from the first row to the last

  double noise_px = 0;  // standard deviation of each coordinate
  Outliers outliers = Outliers::kUniform;
  double outlier_share = 0;     // of the matches of each pair
  double overlay_border = 0.5;  // the overlay fills a frame this wide, over the picture's size; 0.5: all
  MatchGraph graph = MatchGraph::kFull;
  int chain_overlap = 1;

  double scale = 1;  // of the world, then its offset
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  std::uint64_t seed = 1;
};

}  // namespace sfm
