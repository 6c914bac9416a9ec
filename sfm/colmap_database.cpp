#include "sfm/colmap_database.h"

#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <optional>

#include "io/error.h"

namespace sfm {
namespace {

// pair_id = kMaxImages * smaller image id + larger image id.
constexpr std::int64_t kMaxImages = 2147483647;
constexpr int kDescriptorBytes = 128;
// TwoViewGeometry::ConfigurationType: 0 and 1 are failures; 4 planar, 5 panoramic, 6 one of the two.
constexpr int kConfigDegenerate = 1, kConfigPlanar = 4, kConfigPlanarOrPanoramic = 6;

class Connection {
 public:
  explicit Connection(const std::filesystem::path& path) : path_(path) {
    // Not opened read-only: SQLite could then not fold COLMAP's write-ahead log into the file when we close
    // it.
    if (sqlite3_open_v2(path.c_str(), &handle_, SQLITE_OPEN_READWRITE, nullptr) != SQLITE_OK) {
      const std::string message = sqlite3_errmsg(handle_);
      sqlite3_close(handle_);
      handle_ = nullptr;
      Fail(message);
    }
  }
  ~Connection() { sqlite3_close(handle_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void ForEachRow(const std::string& query, const std::function<void(sqlite3_stmt*)>& visit) const {
    sqlite3_stmt* raw = nullptr;
    if (sqlite3_prepare_v2(handle_, query.c_str(), -1, &raw, nullptr) != SQLITE_OK) Fail();
    const std::unique_ptr<sqlite3_stmt, decltype(&sqlite3_finalize)> statement(raw, sqlite3_finalize);
    int result = SQLITE_ROW;
    while ((result = sqlite3_step(raw)) == SQLITE_ROW) visit(raw);
    if (result != SQLITE_DONE) Fail();
  }

  [[noreturn]] void Fail(const std::string& what = "") const {
    throw io::Error(io::ExitCode::kBadState,
                    path_.string() + ": " + (what.empty() ? sqlite3_errmsg(handle_) : what),
                    "It is written anew by running the stage again with --force");
  }

 private:
  std::filesystem::path path_;
  sqlite3* handle_ = nullptr;
};

std::string Text(sqlite3_stmt* row, int column) {
  const unsigned char* text = sqlite3_column_text(row, column);
  return text ? reinterpret_cast<const char*>(text) : "";
}

// Scale of each keypoint in pixels. COLMAP stores x, y, scale, orientation or x, y and a 2x2 affine shape
// whose determinant is the squared scale.
std::vector<double> KeypointScales(const Connection& database, sqlite3_stmt* row, int first_column) {
  const int rows = sqlite3_column_int(row, first_column), cols = sqlite3_column_int(row, first_column + 1);
  const int bytes = sqlite3_column_bytes(row, first_column + 2);
  if (rows < 0 || cols < 2 || cols > 6 || bytes != rows * cols * static_cast<int>(sizeof(float))) {
    database.Fail("keypoints of a picture do not have the stated size");
  }
  std::vector<float> values(static_cast<std::size_t>(rows) * cols);
  if (!values.empty()) std::memcpy(values.data(), sqlite3_column_blob(row, first_column + 2), bytes);
  std::vector<double> scales;
  for (int i = 0; i < rows; ++i) {
    const float* k = &values[static_cast<std::size_t>(i) * cols];
    scales.push_back(
        cols == 6   ? std::sqrt(std::abs(static_cast<double>(k[2]) * k[5] - static_cast<double>(k[3]) * k[4]))
        : cols == 4 ? k[2]
                    : 1.0);
  }
  return scales;
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(
      values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

}  // namespace

std::vector<PictureFeatures> ReadFeatures(const std::filesystem::path& path) {
  const Connection database(path);
  std::vector<PictureFeatures> pictures;
  database.ForEachRow(
      "SELECT images.name, keypoints.rows, keypoints.cols, keypoints.data FROM images "
      "LEFT JOIN keypoints ON keypoints.image_id = images.image_id ORDER BY images.image_id",
      [&](sqlite3_stmt* row) {
        PictureFeatures picture{.name = Text(row, 0)};
        if (sqlite3_column_int(row, 1) > 0) {
          const std::vector<double> scales = KeypointScales(database, row, 1);
          picture.count = static_cast<int>(scales.size());
          picture.median_scale_px = Median(scales);
        }
        pictures.push_back(std::move(picture));
      });
  return pictures;
}

std::vector<Descriptors> ReadLargestDescriptors(const std::filesystem::path& path,
                                                const std::vector<std::string>& names,
                                                int max_count) {
  const Connection database(path);
  std::map<std::string, Descriptors> by_name;
  database.ForEachRow(
      "SELECT images.name, keypoints.rows, keypoints.cols, keypoints.data, descriptors.rows, "
      "descriptors.cols, "
      "descriptors.data FROM images JOIN keypoints ON keypoints.image_id = images.image_id "
      "JOIN descriptors ON descriptors.image_id = images.image_id",
      [&](sqlite3_stmt* row) {
        if (sqlite3_column_int(row, 1) <= 0) return;
        const std::vector<double> scales = KeypointScales(database, row, 1);
        const int rows = static_cast<int>(scales.size());
        if (sqlite3_column_int(row, 4) != rows || sqlite3_column_int(row, 5) != kDescriptorBytes ||
            sqlite3_column_bytes(row, 6) != rows * kDescriptorBytes) {
          database.Fail("descriptors of " + Text(row, 0) + " do not have the stated size");
        }
        std::vector<int> order(scales.size());
        std::iota(order.begin(), order.end(), 0);
        std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return scales[a] > scales[b]; });
        order.resize(std::min<std::size_t>(order.size(), static_cast<std::size_t>(max_count)));
        const auto* bytes = static_cast<const std::uint8_t*>(sqlite3_column_blob(row, 6));
        Descriptors descriptors(static_cast<Eigen::Index>(order.size()), kDescriptorBytes);
        for (std::size_t i = 0; i < order.size(); ++i) {
          descriptors.row(static_cast<Eigen::Index>(i)) =
              Eigen::Map<const Eigen::Matrix<std::uint8_t, 1, kDescriptorBytes>>(
                  bytes + static_cast<std::size_t>(order[i]) * kDescriptorBytes)
                  .cast<float>()
                  .normalized();
        }
        by_name[Text(row, 0)] = std::move(descriptors);
      });
  std::vector<Descriptors> result;
  for (const std::string& name : names) result.push_back(by_name[name]);
  return result;
}

std::vector<VerifiedPair> ReadVerifiedPairs(const std::filesystem::path& path) {
  const Connection database(path);
  std::map<std::int64_t, std::string> names;
  database.ForEachRow("SELECT image_id, name FROM images",
                      [&](sqlite3_stmt* row) { names[sqlite3_column_int64(row, 0)] = Text(row, 1); });
  std::vector<VerifiedPair> pairs;
  database.ForEachRow("SELECT pair_id, rows, config FROM two_view_geometries WHERE rows > 0 ORDER BY pair_id",
                      [&](sqlite3_stmt* row) {
                        const std::int64_t pair_id = sqlite3_column_int64(row, 0);
                        const int config = sqlite3_column_int(row, 2);
                        if (config <= kConfigDegenerate) return;
                        const auto a = names.find(pair_id / kMaxImages), b = names.find(pair_id % kMaxImages);
                        if (a == names.end() || b == names.end())
                          database.Fail("a pair refers to a missing image");
                        const bool flat = config >= kConfigPlanar && config <= kConfigPlanarOrPanoramic;
                        pairs.push_back({a->second,
                                         b->second,
                                         sqlite3_column_int(row, 1),
                                         flat ? PairGeometry::kPlanarOrRotation : PairGeometry::kGeneral});
                      });
  return pairs;
}

}  // namespace sfm
