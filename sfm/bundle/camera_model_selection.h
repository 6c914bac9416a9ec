// The camera model that a capture needs, no richer: chosen by what helps observations that were not used.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "sfm/bundle/bundle_adjustment.h"
#include "sfm/bundle/bundle_uncertainty.h"
#include "sfm/bundle/observation_filter.h"

namespace sfm {

struct CameraModelOptions {
  std::string camera_model = "auto";  // or COLMAP's name of the model to use
  // Per camera: the focal length in pixels from the picture's metadata or the user, 0 where unknown. Empty:
  // all unknown.
  std::vector<double> known_focal_px;
  std::uint64_t seed = 0;  // of the observations that are held out
  int threads = 1;         // does not change the result
};

struct SelectedCameraModel {
  std::string camera_model;          // the richest that one of the cameras needs
  std::vector<FreeIntrinsics> free;  // per camera, in the final adjustment
  AdjustmentReport adjustment;
  BundleUncertainty uncertainty;  // with poses
  FilterReport filter;
};

// Adjusts `model` with the simplest camera model that suffices and removes what does not agree with it.
//
// Forward selection along SIMPLE_PINHOLE -> SIMPLE_RADIAL (k1) -> RADIAL (k2) -> OPENCV (fl_y, p1, p2), with
// the principal point to be freed at any time. An extension helps when the error of held-out observations
// (sfm/bundle/observation_split.h) falls by more than 0.5 % and every new parameter exceeds 3 of its standard
// deviations. One that does not is tried together with the next: k1 and k2 of opposite signs show in both or
// not at all. The principal point is freed when the error falls by as much, both coordinates are
// determined to 5 px and one moves by more than 3 standard deviations. Of two extensions that help, the one
// with the smaller error is taken first: a wrong principal point can pose as distortion, and the reverse. A
// radial term that turns a camera by more than 0.5 degrees needs no such fall, only its significance: over a
// plane seen straight down, a ground bent into a bowl makes up for a missing k1. A focal length that is
// determined no better than 2 % is held, at the known value where there is one: the mapper may have lost it.
// No lens folds its picture: a distortion that would do so inside the picture is not taken, whatever it
// explains. Cameras that hardly move determine theirs that badly.
// Each camera is decided for its own parameters; one with fewer than 200 observations keeps the simplest
// model.
//
// Then every picture gets a focal length of its own, with the lens of its camera (FreeIntrinsics::lens_of),
// when the held-out error falls by more than 2 % and these focal lengths lie more than 3 standard deviations
// (RMS) from the shared one: autofocus moves it by a few percent. The selection is then made anew, because a
// common focal length can pose as distortion. A given camera model is used as it is, for all pictures.
//
// The input's cameras are start values; parameters that are not needed become 0, pixels square, the principal
// point stays. `model` leaves with one camera per picture where each has its own focal length. decide:
// receives one line for every decision. Throws kUsage for an unknown camera model, and what AdjustBundle
// throws.
SelectedCameraModel AdjustWithSelectedCameraModel(io::ColmapModel* model,
                                                  const CameraModelOptions& options,
                                                  const std::function<void(const std::string&)>& decide);

}  // namespace sfm
