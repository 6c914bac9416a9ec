// Why a capture, or one picture of it, could not be reconstructed, found from what its mapping brought.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/scene/colmap_model.h"
#include "sfm/colmap/colmap_database.h"
#include "sfm/mapping/refusal.h"

namespace sfm {

struct PictureFeatures {
  std::string name;
  int count = 0;
  double median_scale_px = 0;  // of the features; large in blurred pictures, where fine detail is gone
};

std::vector<PictureFeatures> Summaries(const std::vector<std::string>& names,
                                       const std::vector<Features>& features);

struct CaptureEvidence {
  std::vector<PictureFeatures> features;  // of every picture
  std::vector<VerifiedPair> pairs;
};

// Median over the points of the widest angle (degrees) between two rays that observe the point; 0 without
// points.
double MedianTriangulationAngleDeg(const io::Scene& scene);

// Share, in [0, 1], of the well supported pairs that a rotation alone explains: near 1 when the camera only
// turned. 0 without such pairs.
double RotationShare(const std::vector<VerifiedPair>& pairs);

// The same share among the pairs that, in this model, see their common points at more than 5 degrees
// (median). A model folded out of a pure rotation claims parallax that none of its pairs shows. 0 without
// such pairs.
double FoldedShare(const io::Scene& scene, const std::vector<VerifiedPair>& pairs);

// The share of those wide pairs that one homography explains, by a rotation or by a plane: near 1 where all
// there is to see is flat.
double FlatShare(const io::Scene& scene, const std::vector<VerifiedPair>& pairs);

// Whether so many of the wide pairs are flat that the pictures determine the focal length and the heights
// above the surface only together.
bool IsFlat(const io::Scene& scene, const std::vector<VerifiedPair>& pairs);

// How far the points spread off the plane that fits them best, over how far they spread in its narrower
// direction, as LineRatio measures it. 0 for a plane, about 1 for a ball. 1 without points.
double PlaneRatio(const io::Scene& scene);

// How wide the points spread across the line that fits them best, over how far they spread along it: root
// mean squares over the half of the points nearest to their median. 0 for points on one line, about 1 for a
// ball. The rotation about such a line cannot be seen. 1 without points.
double LineRatio(const io::Scene& scene);

// Why the model must not be used: too few pictures, rays that hardly diverge, large errors. Nothing when it
// may.
std::optional<Refusal> JudgeModel(const io::ColmapModel& model, const CaptureEvidence& evidence);

// Why no model, or only one of `registered` pictures, was found.
Refusal ExplainFailure(const CaptureEvidence& evidence, int registered);

// Why the picture is missing from the model.
Refusal ExplainMissingPicture(const std::string& name, const CaptureEvidence& evidence);

}  // namespace sfm
