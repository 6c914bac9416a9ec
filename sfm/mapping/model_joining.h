// Models of overlapping parts of a capture become one.
#pragma once

#include <optional>
#include <vector>

#include "io/scene/colmap_model.h"

namespace sfm {

// b -> a, from the points that both models see at the same keypoint of a shared picture: the similarity that
// most of them agree on. Points: 3 each for a hypothesis (RANSAC, Fischler and Bolles 1981), inliers where
// the moved point lies within 0.5 % of the longer side of where the picture shows it, then least squares over
// the inliers. Nothing when the models share fewer than 5 pictures or 50 points, or when fewer than half of
// the points agree: one of the models is folded, or takes another place for this one.
std::optional<io::Sim3d> AlignModels(const io::ColmapModel& a, const io::ColmapModel& b);

// The same for models that share fewer pictures: the picture with most points that both see at the same
// keypoint gives rotation and place, and how deep these points lie before it in each gives the scale. Nothing
// when there are fewer than 8, or when fewer than half of the ratios of depths lie within a tenth of their
// median: one of the models then has the picture in a wrong place.
std::optional<io::Sim3d> AlignAtPicture(const io::ColmapModel& a, const io::ColmapModel& b);

// Adds the pictures of `b` that `a` lacks, moved by `a_from_b`, and its points; points that both see at the
// same keypoint are one. camera_of: of each frame of b, the camera of `a` that took it.
void AddModel(const io::ColmapModel& b,
              const io::Sim3d& a_from_b,
              const std::vector<int>& camera_of,
              io::ColmapModel* a);

}  // namespace sfm
