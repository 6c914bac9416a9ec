// Rays through the pixels of a pinhole camera: the only place where poses go from double to float.
#pragma once

#include "io/scene/scene.h"

namespace nerf {

struct Ray {
  float origin[3], direction[3];  // unit direction, scene coordinates
};

// A pinhole camera in float, ready to shoot rays. Throws kBadInput for a camera with distortion.
class RayCamera {
 public:
  RayCamera(const io::Camera& camera, const io::Rigid3d& world_from_cam, double pixel_offset = 0.5);
  // Ray through (x + pixel_offset, y + pixel_offset), by default the centre of pixel (x, y), or dx and dy
  // pixels beside it.
  Ray RayThrough(int x, int y, float dx = 0, float dy = 0) const;

 private:
  float inv_fl_x_, inv_fl_y_, cx_, cy_;
  float rotation_[9], origin_[3];
};

// One of the cells of a pixel that is cut into a square number of them.
struct PixelCell {
  int column, row;
  float side;  // pixels
  // Offsets from the pixel's centre of the point at shares u and v of the cell's sides.
  float Dx(float u) const { return (static_cast<float>(column) + u) * side - 0.5f; }
  float Dy(float v) const { return (static_cast<float>(row) + v) * side - 0.5f; }
};
PixelCell CellOfPixel(int index, int n_cells);
// Whether a pixel can be cut into so many cells: 1, 4, 9 or 16.
inline bool IsSamplesPerPixel(int n) { return n == 1 || n == 4 || n == 9 || n == 16; }

}  // namespace nerf
