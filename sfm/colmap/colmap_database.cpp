#include "sfm/colmap/colmap_database.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>

#include "io/base/error.h"
#include "sfm/colmap/sqlite.h"

namespace sfm {
namespace {

// pair_id = kMaxImages * smaller image id + larger image id.
constexpr std::int64_t kMaxImages = 2147483647;
// TwoViewGeometry::ConfigurationType: 0 and 1 are failures; 4 planar, 5 panoramic, 6 one of the two.
constexpr int kConfigDegenerate = 1, kConfigUncalibrated = 3, kConfigPlanar = 4, kConfigPlanarOrPanoramic = 6;
constexpr double kFocalGuess = 1.2;  // of the longer side
constexpr int kSensorTypeCamera = 0;

std::string Text(sqlite3_stmt* row, int column) {
  const unsigned char* text = sqlite3_column_text(row, column);
  return text ? reinterpret_cast<const char*>(text) : "";
}

template <typename T>
void BindBlob(sqlite3_stmt* statement, int parameter, const std::vector<T>& values) {
  sqlite3_bind_blob(
      statement, parameter, values.data(), static_cast<int>(values.size() * sizeof(T)), SQLITE_TRANSIENT);
}

// COLMAP's number of the model and its start values.
std::pair<int, std::vector<double>> CameraParameters(const CameraGroup& group, const std::string& model) {
  struct Model {
    int id, focals, distortions;
  };
  static const std::map<std::string, Model> kModels = {{"SIMPLE_PINHOLE", {0, 1, 0}},
                                                       {"PINHOLE", {1, 2, 0}},
                                                       {"SIMPLE_RADIAL", {2, 1, 1}},
                                                       {"RADIAL", {3, 1, 2}},
                                                       {"OPENCV", {4, 2, 4}}};
  const Model& entry = kModels.at(model);
  const double focal = FocalOrGuess(group);
  std::vector<double> parameters(static_cast<std::size_t>(entry.focals), focal);
  parameters.push_back(group.width / 2.0);
  parameters.push_back(group.height / 2.0);
  parameters.resize(parameters.size() + static_cast<std::size_t>(entry.distortions), 0.0);
  return {entry.id, parameters};
}

void WriteCamera(const SqliteConnection& database,
                 int id,
                 const CameraGroup& group,
                 const std::string& model) {
  const auto [model_id, parameters] = CameraParameters(group, model);
  database.Execute(
      "INSERT INTO cameras(camera_id, model, width, height, params, prior_focal_length) VALUES(?,?,?,?,?,?)",
      [&, model_id = model_id, &values = parameters](sqlite3_stmt* s) {
        sqlite3_bind_int(s, 1, id);
        sqlite3_bind_int(s, 2, model_id);
        sqlite3_bind_int(s, 3, group.width);
        sqlite3_bind_int(s, 4, group.height);
        BindBlob(s, 5, values);
        sqlite3_bind_int(s, 6, group.focal_px > 0);
      });
  if (!database.HasTable("rigs")) return;
  database.Execute("INSERT INTO rigs(rig_id, ref_sensor_id, ref_sensor_type) VALUES(?,?,?)",
                   [&](sqlite3_stmt* s) {
                     sqlite3_bind_int(s, 1, id);
                     sqlite3_bind_int(s, 2, id);
                     sqlite3_bind_int(s, 3, kSensorTypeCamera);
                   });
}

void WriteImage(const SqliteConnection& database,
                int id,
                int camera_id,
                const std::string& name,
                const Features& features) {
  database.Execute("INSERT INTO images(image_id, name, camera_id) VALUES(?,?,?)", [&](sqlite3_stmt* s) {
    sqlite3_bind_int(s, 1, id);
    sqlite3_bind_text(s, 2, name.c_str(), -1, SQLITE_TRANSIENT);
    sqlite3_bind_int(s, 3, camera_id);
  });
  static_assert(sizeof(Keypoint) == 4 * sizeof(float), "COLMAP's rows x, y, scale, orientation");
  database.Execute("INSERT INTO keypoints(image_id, rows, cols, data) VALUES(?,?,4,?)", [&](sqlite3_stmt* s) {
    sqlite3_bind_int(s, 1, id);
    sqlite3_bind_int(s, 2, static_cast<int>(features.keypoints.size()));
    BindBlob(s, 3, features.keypoints);
  });
  if (!database.HasTable("frames")) return;
  database.Execute("INSERT INTO frames(frame_id, rig_id) VALUES(?,?)", [&](sqlite3_stmt* s) {
    sqlite3_bind_int(s, 1, id);
    sqlite3_bind_int(s, 2, camera_id);
  });
  database.Execute("INSERT INTO frame_data(frame_id, data_id, sensor_id, sensor_type) VALUES(?,?,?,?)",
                   [&](sqlite3_stmt* s) {
                     sqlite3_bind_int(s, 1, id);
                     sqlite3_bind_int(s, 2, id);
                     sqlite3_bind_int(s, 3, camera_id);
                     sqlite3_bind_int(s, 4, kSensorTypeCamera);
                   });
}

// x, y, scale, orientation, or x, y and a 2x2 affine shape whose determinant is the squared scale.
std::vector<Keypoint> Keypoints(const SqliteConnection& database, sqlite3_stmt* row, int first_column) {
  const int rows = sqlite3_column_int(row, first_column), cols = sqlite3_column_int(row, first_column + 1);
  const int bytes = sqlite3_column_bytes(row, first_column + 2);
  const std::int64_t stated = std::int64_t{rows} * cols * std::int64_t{sizeof(float)};
  if (rows < 0 || cols < 2 || cols > 6 || bytes != stated) {
    database.Fail("keypoints of a picture do not have the stated size");
  }
  std::vector<float> values(static_cast<std::size_t>(std::ptrdiff_t{rows} * cols));
  if (!values.empty())
    std::memcpy(values.data(), sqlite3_column_blob(row, first_column + 2), static_cast<std::size_t>(bytes));
  std::vector<Keypoint> keypoints;
  for (int i = 0; i < rows; ++i) {
    const float* k = &values[static_cast<std::size_t>(std::ptrdiff_t{i} * cols)];
    Keypoint keypoint{.x = k[0], .y = k[1]};
    if (cols == 4) keypoint.scale = k[2], keypoint.angle = k[3];
    if (cols == 6)
      keypoint.scale = std::sqrt(std::abs(k[2] * k[5] - k[3] * k[4])),
      keypoint.angle = std::atan2(k[4], k[2]);
    keypoints.push_back(keypoint);
  }
  return keypoints;
}

// How COLMAP numbers a pair and its matches: the picture of the smaller id comes first.
class PairRows {
 public:
  // names: what pairs count pictures by.
  PairRows(const SqliteConnection& database, const std::vector<std::string>& names) {
    std::map<std::string, std::int64_t> ids;
    database.ForEachRow("SELECT image_id, name FROM images",
                        [&](sqlite3_stmt* row) { ids[Text(row, 1)] = sqlite3_column_int64(row, 0); });
    for (const std::string& name : names) ids_.push_back(ids.at(name));
  }

  // The first three parameters: number, count and indices.
  void Bind(sqlite3_stmt* statement, int a, int b, const std::vector<std::array<int, 2>>& matches) const {
    const std::int64_t id_a = ids_[static_cast<std::size_t>(a)], id_b = ids_[static_cast<std::size_t>(b)];
    std::vector<std::uint32_t> indices;
    for (const auto& [in_a, in_b] : matches) {
      indices.push_back(static_cast<std::uint32_t>(id_a < id_b ? in_a : in_b));
      indices.push_back(static_cast<std::uint32_t>(id_a < id_b ? in_b : in_a));
    }
    sqlite3_bind_int64(statement, 1, kMaxImages * std::min(id_a, id_b) + std::max(id_a, id_b));
    sqlite3_bind_int64(statement, 2, static_cast<std::int64_t>(matches.size()));
    BindBlob(statement, 3, indices);
  }

 private:
  std::vector<std::int64_t> ids_;
};

}  // namespace

double FocalOrGuess(const CameraGroup& group) {
  return group.focal_px > 0 ? group.focal_px : kFocalGuess * std::max(group.width, group.height);
}

void WritePictures(const std::filesystem::path& path,
                   const std::vector<CameraGroup>& groups,
                   const std::string& camera_model,
                   const std::vector<std::string>& names,
                   const std::vector<Features>& features) {
  const SqliteConnection database(path);
  database.Execute("BEGIN");
  std::map<std::string, int> camera_ids;
  int camera_id = 0;
  for (const CameraGroup& group : groups) {
    WriteCamera(database, ++camera_id, group, camera_model);
    for (const std::string& name : group.names) camera_ids[name] = camera_id;
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    WriteImage(database, static_cast<int>(i) + 1, camera_ids.at(names[i]), names[i], features[i]);
  }
  database.Execute("COMMIT");
}

void WriteMatches(const std::filesystem::path& path,
                  const std::vector<std::string>& names,
                  const std::vector<PairMatches>& matches) {
  const SqliteConnection database(path);
  const PairRows rows(database, names);
  database.Execute("BEGIN");
  for (const PairMatches& pair : matches) {
    database.Execute("INSERT INTO matches(pair_id, rows, cols, data) VALUES(?,?,2,?)",
                     [&](sqlite3_stmt* s) { rows.Bind(s, pair.a, pair.b, pair.matches); });
  }
  database.Execute("COMMIT");
}

void WriteGeometries(const std::filesystem::path& path,
                     const std::vector<std::string>& names,
                     const std::vector<PairMatches>& pairs,
                     const std::vector<TwoViewGeometry>& geometries) {
  const SqliteConnection database(path);
  const PairRows rows(database, names);
  database.Execute("BEGIN");
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (geometries[i].kind == TwoViewKind::kNone) continue;
    database.Execute("INSERT INTO two_view_geometries(pair_id, rows, cols, data, config) VALUES(?,?,2,?,?)",
                     [&](sqlite3_stmt* s) {
                       rows.Bind(s, pairs[i].a, pairs[i].b, geometries[i].matches);
                       const bool is_flat = geometries[i].kind == TwoViewKind::kHomography;
                       sqlite3_bind_int(s, 4, is_flat ? kConfigPlanarOrPanoramic : kConfigUncalibrated);
                     });
  }
  database.Execute("COMMIT");
}

void CopyPairs(const std::filesystem::path& from, const std::filesystem::path& to, const PairFilter& takes) {
  const SqliteConnection database(to);
  std::map<std::int64_t, std::string> names;
  database.ForEachRow("SELECT image_id, name FROM images",
                      [&](sqlite3_stmt* row) { names[sqlite3_column_int64(row, 0)] = Text(row, 1); });
  database.Execute("ATTACH ? AS other",
                   [&](sqlite3_stmt* s) { sqlite3_bind_text(s, 1, from.c_str(), -1, SQLITE_TRANSIENT); });
  database.Execute("BEGIN");
  for (const std::string table : {"matches", "two_view_geometries"}) {
    std::vector<std::int64_t> taken;
    database.ForEachRow("SELECT pair_id FROM other." + table, [&](sqlite3_stmt* row) {
      const std::int64_t id = sqlite3_column_int64(row, 0);
      const auto a = names.find(id / kMaxImages), b = names.find(id % kMaxImages);
      if (a == names.end() || b == names.end()) database.Fail("a pair refers to a missing image");
      if (takes(a->second, b->second)) taken.push_back(id);
    });
    for (const std::int64_t id : taken) {
      database.Execute("INSERT INTO " + table + " SELECT * FROM other." + table + " WHERE pair_id = ?",
                       [&](sqlite3_stmt* s) { sqlite3_bind_int64(s, 1, id); });
    }
  }
  database.Execute("COMMIT");
  database.Execute("DETACH other");
}

std::vector<Features> ReadFeatures(const std::filesystem::path& path, const std::vector<std::string>& names) {
  const SqliteConnection database(path);
  std::map<std::string, Features> by_name;
  database.ForEachRow(
      "SELECT images.name, keypoints.rows, keypoints.cols, keypoints.data, descriptors.rows, "
      "descriptors.cols, "
      "descriptors.data FROM images LEFT JOIN keypoints ON keypoints.image_id = images.image_id "
      "LEFT JOIN descriptors ON descriptors.image_id = images.image_id",
      [&](sqlite3_stmt* row) {
        Features& features = by_name[Text(row, 0)];
        if (sqlite3_column_int(row, 1) <= 0) return;
        features.keypoints = Keypoints(database, row, 1);
        const int rows = static_cast<int>(features.keypoints.size());
        if (sqlite3_column_int(row, 4) != rows || sqlite3_column_int(row, 5) != kDescriptorBytes ||
            sqlite3_column_bytes(row, 6) != std::int64_t{rows} * kDescriptorBytes) {
          database.Fail("descriptors of " + Text(row, 0) + " do not have the stated size");
        }
        const auto* bytes = static_cast<const std::uint8_t*>(sqlite3_column_blob(row, 6));
        features.descriptors.assign(bytes, bytes + sqlite3_column_bytes(row, 6));
      });
  std::vector<Features> result;
  for (const std::string& name : names) {
    const auto found = by_name.find(name);
    if (found == by_name.end()) {
      throw io::Error(io::ExitCode::kMissingTool,
                      "colmap feature_extractor reported success but skipped " + name);
    }
    result.push_back(std::move(found->second));
  }
  return result;
}

std::vector<VerifiedPair> ReadVerifiedPairs(const std::filesystem::path& path) {
  const SqliteConnection database(path);
  std::map<std::int64_t, std::string> names;
  database.ForEachRow("SELECT image_id, name FROM images",
                      [&](sqlite3_stmt* row) { names[sqlite3_column_int64(row, 0)] = Text(row, 1); });
  std::vector<VerifiedPair> pairs;
  database.ForEachRow(
      "SELECT pair_id, rows, config, data FROM two_view_geometries WHERE rows > 0 ORDER BY pair_id",
      [&](sqlite3_stmt* row) {
        const std::int64_t pair_id = sqlite3_column_int64(row, 0);
        const int inliers = sqlite3_column_int(row, 1), config = sqlite3_column_int(row, 2);
        if (config <= kConfigDegenerate) return;
        const auto a = names.find(pair_id / kMaxImages), b = names.find(pair_id % kMaxImages);
        if (a == names.end() || b == names.end()) database.Fail("a pair refers to a missing image");
        std::vector<std::array<std::uint32_t, 2>> indices(static_cast<std::size_t>(inliers));
        if (sqlite3_column_bytes(row, 3) != static_cast<int>(indices.size() * sizeof indices[0])) {
          database.Fail("inliers of " + a->second + " and " + b->second + " do not have the stated size");
        }
        std::memcpy(indices.data(), sqlite3_column_blob(row, 3), indices.size() * sizeof indices[0]);
        const bool flat = config >= kConfigPlanar && config <= kConfigPlanarOrPanoramic;
        pairs.push_back(
            {a->second, b->second, inliers, flat ? PairGeometry::kHomography : PairGeometry::kGeneral});
        for (const auto& [in_a, in_b] : indices) {
          pairs.back().matches.push_back({static_cast<int>(in_a), static_cast<int>(in_b)});
        }
      });
  return pairs;
}

}  // namespace sfm
