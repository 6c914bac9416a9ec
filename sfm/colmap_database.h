// What COLMAP's SQLite database says it found. Read-only and verified: COLMAP skips unreadable pictures and
// exits 0. Schema: https://colmap.github.io/database.html, equal from 3.8 to 4.x in the columns used here.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace sfm {

// Rows are unit-length descriptors.
using Descriptors = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct PictureFeatures {
  std::string name;
  int count = 0;
  double median_scale_px = 0;  // of the features; large in blurred pictures, where fine detail is gone
};

// COLMAP's class of a verified pair, as far as it matters here.
enum class PairGeometry { kGeneral, kPlanarOrRotation };

struct VerifiedPair {
  std::string name_a, name_b;
  int inliers = 0;
  PairGeometry geometry = PairGeometry::kGeneral;
};

// All functions throw io::Error kBadState when the file is not such a database or contradicts itself.

// One entry per picture of the database, in order of its image id.
std::vector<PictureFeatures> ReadFeatures(const std::filesystem::path& database);

// The `max_count` features of largest scale of each picture, in the order of `names`; no rows for a picture
// without features.
std::vector<Descriptors> ReadLargestDescriptors(const std::filesystem::path& database,
                                                const std::vector<std::string>& names,
                                                int max_count);

// Pairs with a verified two-view geometry.
std::vector<VerifiedPair> ReadVerifiedPairs(const std::filesystem::path& database);

}  // namespace sfm
