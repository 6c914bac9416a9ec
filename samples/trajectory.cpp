// Orbits, walks and degenerate motions.
#include "samples/trajectory.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "samples/noise.h"

namespace samples {
namespace {

using Vec3 = Eigen::Vector3d;
using std::numbers::pi;
constexpr double kDegree = pi / 180;
const Vec3 kAim(0, 0, 0.42);  // middle of the still life

// Looks from eye to aim with the horizon turned by roll.
io::Rigid3d LookAt(const Vec3& eye, const Vec3& aim, double roll) {
  const Vec3 back = (eye - aim).normalized();
  const Vec3 right = Vec3::UnitZ().cross(back).normalized();
  io::Rigid3d pose;
  pose.rotation << right, back.cross(right), back;
  pose.rotation = pose.rotation * Eigen::AngleAxisd(roll, Vec3::UnitZ()).toRotationMatrix();
  pose.translation = eye;
  return pose;
}

Vec3 OnSphere(double radius, double azimuth, double elevation) {
  return kAim + radius * Vec3(std::cos(azimuth) * std::cos(elevation),
                              std::sin(azimuth) * std::cos(elevation),
                              std::sin(elevation));
}

double Jitter(int index, int which, double amount, std::uint64_t seed) {
  return amount * (2 * UnitHash(index, which, seed) - 1);
}

}  // namespace

std::vector<io::Rigid3d> OrbitPoses(int count, std::uint64_t seed) {
  // SIFT matches within about 30 degrees: twenty pictures a turn leave a margin, more are better spent on
  // height.
  const int turns = std::clamp(count / 20, 1, 3);
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < count; ++i) {
    const double turn = static_cast<double>(turns) * i / count;
    const double azimuth = 2 * pi * turn + Jitter(i, 0, 2.5 * kDegree, seed);
    const double elevation =
        (22 + 30 * turn / 3 + (turns == 1 ? 8 : 0)) * kDegree + Jitter(i, 1, 3 * kDegree, seed);
    const double radius = kOrbitRadius * (1 + Jitter(i, 2, 0.06, seed));
    const Vec3 aim =
        kAim + Vec3(Jitter(i, 3, 0.12, seed), Jitter(i, 4, 0.12, seed), Jitter(i, 5, 0.08, seed));
    poses.push_back(LookAt(OnSphere(radius, azimuth, elevation), aim, Jitter(i, 6, 4 * kDegree, seed)));
  }
  return poses;
}

std::vector<io::Rigid3d> RotationPoses(int count, std::uint64_t seed) {
  const Vec3 eye = OnSphere(kOrbitRadius, -100 * kDegree, 25 * kDegree);
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < count; ++i) {
    const double yaw = (-50 + 100.0 * (i + 0.5) / count) * kDegree, pitch = Jitter(i, 0, 6 * kDegree, seed);
    const Vec3 ahead = kAim - eye;
    const Vec3 aim =
        eye + Eigen::AngleAxisd(yaw, Vec3::UnitZ()) * ahead + Vec3(0, 0, std::tan(pitch) * ahead.norm());
    poses.push_back(LookAt(eye, aim, Jitter(i, 1, 3 * kDegree, seed)));
  }
  return poses;
}

std::vector<io::Rigid3d> ForwardPoses(int count, std::uint64_t seed) {
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < count; ++i) {
    const double radius = 4.8 - 2.6 * i / std::max(count - 1, 1);
    const Vec3 aim =
        kAim + Vec3(Jitter(i, 0, 0.02, seed), Jitter(i, 1, 0.02, seed), Jitter(i, 2, 0.02, seed));
    poses.push_back(LookAt(OnSphere(radius, -70 * kDegree, 24 * kDegree), aim, Jitter(i, 3, kDegree, seed)));
  }
  return poses;
}

std::vector<io::Rigid3d> TestPoses(int count) {
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < count; ++i) {
    const double azimuth = (2 * pi * i) / count + 7 * kDegree, elevation = (26 + 7 * (i % 4)) * kDegree;
    poses.push_back(LookAt(OnSphere(kOrbitRadius, azimuth, elevation), kAim, 0));
  }
  return poses;
}

io::Rigid3d WalkPose(double time_s, double duration_s, std::uint64_t seed) {
  const double turn = time_s / duration_s;
  // Steps and breath: smooth noise of a few hertz with amplitudes of a careful hand.
  const auto shake = [&](int which, double hertz, double amount) {
    return amount * (2 * FractalNoise(hertz * time_s, 100.0 * which, 2, seed + 200) - 1);
  };
  const double elevation = (31 + 8 * std::sin(4 * pi * turn)) * kDegree + shake(0, 1.2, 1.2 * kDegree);
  const double radius = kOrbitRadius * (1 + 0.04 * std::sin(6 * pi * turn)) + shake(1, 1.5, 0.05);
  const Vec3 aim = kAim + Vec3(shake(2, 2, 0.06), shake(3, 2, 0.06), shake(4, 2, 0.06));
  return LookAt(OnSphere(radius, 2 * pi * turn - 0.5 * pi, elevation), aim, shake(5, 1.5, 1.5 * kDegree));
}

io::Rigid3d KnockedPose(const io::Rigid3d& world_from_cam, double angle) {
  io::Rigid3d knocked = world_from_cam;
  knocked.rotation = knocked.rotation * Eigen::AngleAxisd(angle, Vec3(0.6, 0.8, 0)).toRotationMatrix();
  return knocked;
}

}  // namespace samples
