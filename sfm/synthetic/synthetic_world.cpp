#include "sfm/synthetic/synthetic_world.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sfm {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kFill = 0.8;  // of half the field of view
// A hand leaves the path by a third of a step, aims a tenth of the subject off, and tilts.
constexpr double kHandShare = 0.3, kAim = 0.1, kTilt = 5 * kDegree;
// A walker or a drone keeps its course better.
constexpr double kCourseShare = 0.1, kCourseTilt = 0.5 * kDegree;
constexpr double kElevation = 15 * kDegree;  // of rings and arcs
constexpr double kClusterAzimuth = 30 * kDegree;
constexpr double kSpiralTurns = 2, kSpiralLow = -20 * kDegree, kSpiralHigh = 60 * kDegree;
constexpr double kTurnedAside = 4 * kDegree;  // the second picture from one spot
constexpr double kTurnShare = 0.8;            // of the field of view, over which kRotationOnly turns
constexpr double kNodShare = 0.2;             // the same, up and down
constexpr double kFarDistances = 1e4;         // far points differ by no measurable parallax
constexpr double kBoxHalf = 0.65;             // so that its corners stay within radius 1
constexpr double kSideRelief = 0.1;
constexpr int kTiles = 6;              // along each side of the floor
constexpr double kCorridorDepths = 3;  // behind the last camera, in viewing distances

Eigen::Vector3d OnSphere(double azimuth, double elevation, double distance) {
  return distance * Eigen::Vector3d(std::cos(elevation) * std::sin(azimuth),
                                    std::sin(elevation),
                                    std::cos(elevation) * std::cos(azimuth));
}

Eigen::Vector3d InBox(Random* random, double half) {
  const double x = random->Uniform(-half, half), y = random->Uniform(-half, half);
  return {x, y, random->Uniform(-half, half)};
}

Eigen::Vector3d InBall(Random* random) {
  Eigen::Vector3d x = InBox(random, 1);
  while (x.norm() > 1) x = InBox(random, 1);
  return x;
}

io::Rigid3d LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, double roll) {
  const Eigen::Vector3d back = (eye - target).normalized();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(back).normalized();
  io::Rigid3d pose;
  pose.rotation << right, back.cross(right), back;
  pose.rotation *= Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  pose.translation = eye;
  return pose;
}

double HalfFieldOfView(const io::Camera& camera) {
  return std::atan(0.5 * std::min(camera.width / camera.fl_x, camera.height / camera.fl_y));
}

int GridSide(int pictures) { return static_cast<int>(std::ceil(std::sqrt(pictures))); }

// Half the way along x, and along y, of trajectories that pass the subject instead of facing it.
Eigen::Vector2d Reach(const CaptureOptions& options, double distance) {
  const double step = options.baseline * distance;
  if (options.trajectory == Trajectory::kLine) return {0.5 * step * (options.pictures - 1), 0};
  if (options.trajectory != Trajectory::kNadirGrid) return {0, 0};
  return Eigen::Vector2d::Constant(0.5 * step * (GridSide(options.pictures) - 1));
}

// A camera aimed at the subject by hand.
io::Rigid3d AimedByHand(const Eigen::Vector3d& eye, double step, Random* random) {
  const Eigen::Vector3d shaken = eye + kHandShare * step * InBall(random);
  const Eigen::Vector3d target = kAim * InBall(random);
  return LookAt(shaken, target, random->Uniform(-kTilt, kTilt));
}

// A camera that looks along -z and keeps its course.
io::Rigid3d OnCourse(const Eigen::Vector3d& eye, double step, Random* random) {
  const Eigen::Vector3d shaken = eye + kCourseShare * step * InBall(random);
  const Eigen::Vector3d turn = kCourseTilt * InBall(random);
  return {Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix(), shaken};
}

io::Rigid3d MakePose(const CaptureOptions& options, int i, double distance, Random* random) {
  const int n = options.pictures;
  const double step = options.baseline * distance;
  const double from_middle = i - 0.5 * (n - 1), share = n > 1 ? static_cast<double>(i) / (n - 1) : 0.5;
  const double turn = 2 * std::numbers::pi / n;
  switch (options.trajectory) {
    case Trajectory::kRing:
      return AimedByHand(OnSphere(turn * i, kElevation, distance), turn * distance, random);
    case Trajectory::kArc:
      return AimedByHand(OnSphere(options.baseline * from_middle, kElevation, distance), step, random);
    case Trajectory::kTwoClusters: {
      const double side = 2 * i < n ? -1 : 1;
      const double azimuth = side * kClusterAzimuth + options.baseline * (i % ((n + 1) / 2));
      return AimedByHand(OnSphere(azimuth, kElevation, distance), step, random);
    }
    case Trajectory::kSpiral:
      return AimedByHand(
          OnSphere(kSpiralTurns * turn * i, std::lerp(kSpiralLow, kSpiralHigh, share), distance),
          kSpiralTurns * turn * distance,
          random);
    case Trajectory::kLine:
      return {Eigen::Matrix3d::Identity(), {step * from_middle, 0, distance}};
    case Trajectory::kForward:
      return OnCourse({0, 0, distance + step * (n - 1 - i)}, step, random);
    case Trajectory::kNadirGrid: {
      const int side = GridSide(n);
      return OnCourse({step * (i % side - 0.5 * (side - 1)), step * (i / side - 0.5 * (side - 1)), distance},
                      step,
                      random);
    }
    case Trajectory::kRotationOnly: {
      const double field = 2 * HalfFieldOfView(options.cameras.front());
      const double yaw = kTurnShare * field * (share - 0.5);
      const double pitch = kNodShare * field * random->Uniform(-1, 1);
      const Eigen::Vector3d eye(0, 0, distance);
      return LookAt(eye, eye - OnSphere(yaw, pitch, 1), random->Uniform(-kTilt, kTilt));
    }
  }
  return {};
}

// A box of which `alike` sides, 4 or 2 opposite ones, look the same; four points at a time, one on each side.
std::vector<WorldPoint> MakeBox(int points, int alike, Random* random) {
  std::vector<WorldPoint> structure;
  const int n_looks = 4 / alike;
  for (int spot = 0; spot < (points + 2) / 4; ++spot) {
    std::vector<Eigen::Vector3d> looks;
    for (int look = 0; look < n_looks; ++look) {
      looks.push_back(InBox(random, kBoxHalf));
      looks.back().z() = kBoxHalf + random->Uniform(0, kSideRelief);
    }
    for (int side = 0; side < 4; ++side) {
      const int look = side % n_looks;
      const Eigen::Matrix3d world_from_side =
          Eigen::AngleAxisd(side * std::numbers::pi / 2, Eigen::Vector3d::UnitY()).toRotationMatrix();
      structure.push_back({.xyz = world_from_side * looks[static_cast<std::size_t>(look)],
                           .normal = world_from_side.col(2),
                           .pattern = spot * n_looks + look,
                           .world_from_pattern = world_from_side});
    }
  }
  return structure;
}

// The same spots on every tile.
std::vector<WorldPoint> MakeTiledFloor(const CaptureOptions& options, double distance, Random* random) {
  const Eigen::Vector2d half = Eigen::Vector2d::Ones() + Reach(options, distance), tile = 2 * half / kTiles;
  std::vector<WorldPoint> structure;
  for (int pattern = 0; pattern < options.points / (kTiles * kTiles); ++pattern) {
    const double u = random->Uniform(), v = random->Uniform();
    const double height = options.relief * distance * random->Uniform(-1, 1);
    for (int i = 0; i < kTiles * kTiles; ++i) {
      const double x = tile.x() * (i % kTiles + u) - half.x(), y = tile.y() * (i / kTiles + v) - half.y();
      structure.push_back({.xyz = {x, y, height}, .pattern = pattern});
    }
  }
  return structure;
}

Eigen::Vector3d MakePoint(const CaptureOptions& options, double distance, Random* random) {
  const Eigen::Vector2d widening = Eigen::Vector2d::Ones() + Reach(options, distance);
  Eigen::Vector3d x = InBall(random);
  switch (options.structure) {
    case Structure::kPlane:
      x.z() = options.relief * distance * random->Uniform(-1, 1);
      break;
    case Structure::kField:
      x = InBox(random, 1);
      x.z() *= options.relief * distance;
      break;
    case Structure::kTwoPlanes:
      x.z() = -std::abs(x.x());
      break;
    case Structure::kLine:
      x.y() = x.z() = 0;
      break;
    case Structure::kCorridor: {
      const double near_end = distance + options.baseline * distance * (options.pictures - 1);
      const double on_wall = random->Uniform(-1, 1),
                   z = random->Uniform(-kCorridorDepths * distance, near_end);
      const double wall = random->Uniform() < 0.5 ? -1 : 1;
      x = random->Uniform() < 0.5 ? Eigen::Vector3d(wall, on_wall, z) : Eigen::Vector3d(on_wall, wall, z);
      break;
    }
    case Structure::kBall:
    case Structure::kIdenticalSides:
    case Structure::kTwoFacades:
    case Structure::kTiledFloor:
      break;
  }
  return {x.x() * widening.x(), x.y() * widening.y(), x.z()};
}

}  // namespace

double ViewingDistance(const io::Camera& camera) { return 1 / std::sin(kFill * HalfFieldOfView(camera)); }

std::vector<io::Rigid3d> MakeTrajectory(const CaptureOptions& options, Random* random) {
  const double distance = ViewingDistance(options.cameras.front());
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < options.pictures; ++i) {
    poses.push_back(MakePose(options, i, distance, random));
    // Evenly spread over the capture.
    if (i == 0 ||
        std::floor(options.rotation_only_share * i) == std::floor(options.rotation_only_share * (i - 1)))
      continue;
    const io::Rigid3d& before = poses[poses.size() - 2];
    poses.back() = {
        before.rotation * Eigen::AngleAxisd(kTurnedAside, InBall(random).normalized()).toRotationMatrix(),
        before.translation};
  }
  poses.insert(poses.begin(), static_cast<std::size_t>(options.duplicates), poses.front());
  return poses;
}

std::vector<WorldPoint> MakeStructure(const CaptureOptions& options, Random* random) {
  const double distance = ViewingDistance(options.cameras.front());
  if (options.structure == Structure::kIdenticalSides) return MakeBox(options.points, 4, random);
  if (options.structure == Structure::kTwoFacades) return MakeBox(options.points, 2, random);
  if (options.structure == Structure::kTiledFloor) return MakeTiledFloor(options, distance, random);
  const int near_points = options.points - static_cast<int>(std::lround(options.far_share * options.points));
  std::vector<WorldPoint> structure;
  for (int i = 0; i < options.points; ++i) {
    const Eigen::Vector3d x = i < near_points ? MakePoint(options, distance, random)
                                              : kFarDistances * distance * InBall(random).normalized();
    structure.push_back({.xyz = x, .pattern = i});
  }
  return structure;
}

}  // namespace sfm
