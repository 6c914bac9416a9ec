// Paint of the table top, the floor and the round wall: pure functions of position, linear albedo.
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace samples {

inline constexpr double kTableRadius = 1.5, kTableThickness = 0.08;
inline constexpr double kRoomRadius = 5.5, kFloorZ = -1.0, kCeilingZ = 4.6;

// x, y on the table top: boards with grain and scratches, a cloth under the figurine, postcards.
Eigen::Vector3d PaintTable(double x, double y, std::uint64_t seed);

// x, y on the floor: parquet with a round rug.
Eigen::Vector3d PaintFloor(double x, double y, std::uint64_t seed);

// arc in [0, 2 pi R), z in [kFloorZ, kCeilingZ]: plaster above panels, hung with pictures.
Eigen::Vector3d PaintWall(double arc, double z, std::uint64_t seed);

}  // namespace samples
