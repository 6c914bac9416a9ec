// Which training views saw what a rendered picture shows. A view supports a pixel when the surface point of
// the pixel lies in its picture, where its mask uses it, and the view's own rendered depth there is that of
// the point. A view that sees through the place of the point does not support it but has observed the place;
// a pixel whose place no view has observed shows nothing that was photographed.
#pragma once

#include <cstdint>
#include <vector>

#include "io/image/mask.h"
#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"

namespace nerf {

struct ViewSupport {
  int width = 0, height = 0;           // smaller than the rendered picture, of the same shape
  std::vector<std::uint16_t> views;    // [height][width], number of views that support the pixel
  std::vector<float> angle;            // [height][width], the largest between two of them, radians
  std::vector<std::uint8_t> observed;  // [height][width], 1: some view has observed the place
  double UnobservedShare() const;
};

class SupportMap {
 public:
  // Renders the depth of every training view at kMaxSide pixels.
  SupportMap(const TrainedField& field, const io::Scene& train, int threads);

  // Of `view`, rendered with the given camera; at most kMaxSide pixels a side.
  ViewSupport Of(const io::Camera& camera,
                 const io::Rigid3d& world_from_cam,
                 const RenderedView& view,
                 int threads) const;
  // The same without views and angles, which takes a fraction of the time.
  ViewSupport ObservedIn(const io::Camera& camera,
                         const io::Rigid3d& world_from_cam,
                         const RenderedView& view,
                         int threads) const;

  // Number of views that support a point which a picture with pixels of `pixel_angle` radians, taken from
  // `centre`, shows.
  int ViewsOf(const Eigen::Vector3d& point, const Eigen::Vector3d& centre, double pixel_angle) const;

  static constexpr int kMaxSide = 128;
  // A depth agrees with another within so many pixels' footprints: half for the pixel that is looked up, as
  // much for the one that looks, and two for a surface at a slant of 60 degrees and the sampling interval,
  // which is below a footprint at this size.
  static constexpr double kFootprints = 3;
  // A place counts as observed up to this share of its distance behind what a view shows: so far do the
  // expected depths of one smooth surface differ between views.
  static constexpr double kBehindShare = 0.1;

 private:
  struct SeenDepth {
    io::Camera camera;
    io::Rigid3d world_from_cam, cam_from_world;
    io::Mask mask;             // of the camera's size
    std::vector<float> depth;  // [height][width]
  };
  // The point that a pixel shows, and how it was seen.
  struct Place {
    Eigen::Vector3d point, film_centre;
    double pixel_angle;  // of the picture that shows it
  };
  // Whether the view supports the place, and whether it has observed it.
  static void Look(const SeenDepth& view, const Place& place, bool* supports, bool* observes);
  // The places that the pixels of a smaller picture show, row by row.
  static std::vector<Place> Places(const io::Camera& small,
                                   const io::Rigid3d& world_from_cam,
                                   const RenderedView& view);

  std::vector<SeenDepth> views_;
};

// Shows what was not observed plainly: the tone replaces the colour, in proportion to how little was observed
// around a pixel. The transition is some pixels of the map wide, and smaller holes are left, so that single
// pixels do not flicker. is_cropped: the light that passes shows a background and nothing else.
void VeilUnobserved(const ViewSupport& support,
                    const std::array<float, 3>& tone,
                    bool is_cropped,
                    RenderedView* view);

// The same by what the field learnt, which takes no time. In a crop box, light that leaves it counts as
// learnt.
void VeilUnlearnt(const std::array<float, 3>& tone, RenderedView* view);

// Radians across a pixel in the middle of the picture.
double PixelAngle(const io::Camera& camera);

// The camera for a picture of at most `side` pixels.
io::Camera SmallCamera(const io::Camera& camera, int side);

}  // namespace nerf
