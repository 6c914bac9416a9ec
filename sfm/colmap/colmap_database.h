// COLMAP's SQLite database: features, matches and verified pairs go in and come out. Contents are checked
// when read: COLMAP skips unreadable pictures and exits 0. Schema: https://colmap.github.io/database.html,
// equal from 3.8 to 4.x in the columns used here; the rigs and frames of 3.12 and later are filled in
// trivially where the tables exist.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "sfm/features/features.h"
#include "sfm/features/matching.h"
#include "sfm/features/two_view.h"

namespace sfm {

// Pictures that share one camera: same size, same lens setting.
struct CameraGroup {
  std::vector<std::string> names;
  int width = 0, height = 0;
  double focal_px = 0;  // 0: unknown, 1.2 times the longer side is the start value (COLMAP's guess)
};

// The focal length, or the guess in its place.
double FocalOrGuess(const CameraGroup& group);

// COLMAP's class of a verified pair, as far as it matters here. It leaves open whether a pair that a
// homography explains is a plane or a rotation; DistinguishFlatPairs decides that.
enum class PairGeometry { kGeneral, kHomography, kPlane, kRotation };

struct VerifiedPair {
  std::string name_a, name_b;
  int inliers = 0;
  PairGeometry geometry = PairGeometry::kGeneral;
  std::vector<std::array<int, 2>> matches;  // the inliers, as keypoints of a and of b
};

// All functions throw io::Error kBadState when the file is not such a database or contradicts itself.

// Adds cameras, pictures and keypoints to an empty database; features[i] belongs to names[i], and every name
// is in one group. camera_model: COLMAP's name, see io/scene/colmap_model.h.
void WritePictures(const std::filesystem::path& database,
                   const std::vector<CameraGroup>& groups,
                   const std::string& camera_model,
                   const std::vector<std::string>& names,
                   const std::vector<Features>& features);

// Adds matches; PairMatches::a and b are indices of `names`.
void WriteMatches(const std::filesystem::path& database,
                  const std::vector<std::string>& names,
                  const std::vector<PairMatches>& matches);

// Adds what explains these pairs, for those that anything explains. The matrices stay empty: the mapper
// estimates them again from the matches where it wants them.
void WriteGeometries(const std::filesystem::path& database,
                     const std::vector<std::string>& names,
                     const std::vector<PairMatches>& pairs,
                     const std::vector<TwoViewGeometry>& geometries);

// Whether to take a pair of pictures, by their names.
using PairFilter = std::function<bool(const std::string&, const std::string&)>;

// Appends what a database of the same pictures, in the same order, holds about the pairs to be taken: those
// of pictures whose keypoints are the same there.
void CopyPairs(const std::filesystem::path& from, const std::filesystem::path& to, const PairFilter& takes);

// Keypoints and descriptors that COLMAP extracted; one entry per name, empty for a picture without features.
// Throws kMissingTool naming a picture that the database lacks.
std::vector<Features> ReadFeatures(const std::filesystem::path& database,
                                   const std::vector<std::string>& names);

// Pairs with a verified two-view geometry.
std::vector<VerifiedPair> ReadVerifiedPairs(const std::filesystem::path& database);

}  // namespace sfm
