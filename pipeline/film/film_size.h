// How large the film is.
#pragma once

#include <functional>
#include <string>

#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"

namespace pipeline {

struct FilmSize {
  io::Camera camera;
  // Sides of the field's picture, which is magnified where splats lie over it, against those in training.
  double field_share = nerf::kFieldPictureShare;
};

// Longer side of the default film.
inline constexpr int kFilmSide = 1280;

// The camera resized to about `width`, with even sides, as yuv420p needs.
io::Camera EvenCamera(const io::Camera& camera, double width);

// The camera of the film: the first training camera, resized to even width and height. Without a width, the
// longer side is kFilmSide, but not more than the photos have, nor less than the training pictures.
io::Camera FilmCamera(const io::Scene& train, int width, int photo_side);

// Makes the film smaller until expected_s() of it, seconds, is at most the ceiling: first the field's picture
// under splats, then the film, which becomes no narrower than the training pictures. Returns one line on what
// was done; empty: nothing was.
std::string KeepUnder(double ceiling_s,
                      int trained_width,
                      bool has_splats,
                      const std::function<double()>& expected_s,
                      FilmSize* size);

}  // namespace pipeline
