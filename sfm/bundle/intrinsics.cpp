#include "sfm/bundle/intrinsics.h"

namespace sfm {

std::vector<int> FreeIndices(const FreeIntrinsics& free) {
  const bool is_free[kIntrinsics] = {free.focal,
                                     free.aspect,
                                     free.principal_point,
                                     free.principal_point,
                                     free.k1,
                                     free.k2,
                                     free.tangential,
                                     free.tangential};
  std::vector<int> indices;
  for (int i = 0; i < kIntrinsics; ++i) {
    if (is_free[i]) indices.push_back(i);
  }
  return indices;
}

std::vector<std::size_t> LensOwners(const std::vector<FreeIntrinsics>& free) {
  std::vector<std::size_t> owners;
  for (std::size_t i = 0; i < free.size(); ++i) {
    owners.push_back(free[i].lens_of < 0 ? i : static_cast<std::size_t>(free[i].lens_of));
  }
  return owners;
}

IntrinsicVector ToVector(const io::Camera& c) {
  return (IntrinsicVector() << c.fl_x, c.fl_y / c.fl_x, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2).finished();
}

io::Camera WithIntrinsics(const io::Camera& camera, const IntrinsicVector& v) {
  if (v == ToVector(camera)) return camera;  // aspect * fl_x need not round back to fl_y
  return {.width = camera.width,
          .height = camera.height,
          .fl_x = v[kFocal],
          .fl_y = v[kAspect] * v[kFocal],
          .cx = v[kCx],
          .cy = v[kCy],
          .k1 = v[kK1],
          .k2 = v[kK2],
          .p1 = v[kP1],
          .p2 = v[kP2]};
}

}  // namespace sfm
