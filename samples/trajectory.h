// Where the photographer stands. Poses are world_from_cam with OpenGL axes; the world's z is up and its
// origin is the middle of the table top; lengths are in scene units.
#pragma once

#include <cstdint>
#include <vector>

#include "io/scene/pose.h"

namespace samples {

inline constexpr double kOrbitRadius =
    3.9;  // three times the figurine's height, four times its width and more

// One to three turns at rising height, hand-held: radius, height, aim and roll jitter.
std::vector<io::Rigid3d> OrbitPoses(int count, std::uint64_t seed);

// The camera turns about its own centre: no baseline, so nothing can be reconstructed.
std::vector<io::Rigid3d> RotationPoses(int count, std::uint64_t seed);

// The camera walks straight towards the figurine.
std::vector<io::Rigid3d> ForwardPoses(int count, std::uint64_t seed);

// Held-out views between the orbit's, without jitter.
std::vector<io::Rigid3d> TestPoses(int count);

// Walking once around in `duration_s` with a shaking hand; time_s is continuous.
io::Rigid3d WalkPose(double time_s, double duration_s, std::uint64_t seed);

// The same pose after a knock that has turned the camera by `angle` radians about an axis across its line of
// sight.
io::Rigid3d KnockedPose(const io::Rigid3d& world_from_cam, double angle);

}  // namespace samples
