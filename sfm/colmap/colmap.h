// Runs the installed COLMAP step by step. Each step gets an argument vector, a wall-clock and an
// address-space limit, and its product is verified: COLMAP exits 0 after skipping unreadable pictures or on a
// full disk. Every process works with one thread, the only way in which COLMAP repeats itself bit for bit
// (colmap/colmap#727); blocks of pictures are spread over processes, and over ranks
// (io/process/shared_work.h).
#pragma once

#include <cstddef>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "io/process/shared_work.h"
#include "sfm/colmap/colmap_database.h"
#include "sfm/colmap/colmap_options.h"

namespace sfm {

// The pictures of a capture, as COLMAP gets to know them. features[i] belongs to names[i].
struct CapturedViews {
  std::vector<std::string> names;
  std::vector<CameraGroup> groups;
  std::vector<Features> features;
  std::string camera_model = "SIMPLE_RADIAL";
};

class Colmap {
 public:
  // work_folder: empty and private; receives database.db, sparse/ and colmap.log. Throws io::Error
  // kMissingTool when COLMAP is not on PATH or lacks an option.
  Colmap(const std::filesystem::path& work_folder, int threads);

  // What other ranks do for a Colmap of rank 0 in a folder of `work_folder`: in folders of their own inside
  // that one, which all must see.
  static void AddWorks(const std::filesystem::path& work_folder,
                       const std::filesystem::path& images_folder,
                       int threads,
                       io::ToldWorks* works);

  // COLMAP's own SIFT on the CPU, as an alternative to DetectFeatures; beyond options.max_features, the
  // largest ones. Throws kMissingTool when a picture did not reach the database.
  std::vector<Features> ExtractFeatures(const std::filesystem::path& images_folder,
                                        const std::vector<CameraGroup>& groups,
                                        const std::vector<std::string>& names,
                                        const FeatureOptions& options);

  // Leaves views, matches and the two-view geometry of each pair (sfm/features/two_view.h) in database().
  void VerifyMatches(const CapturedViews& views, const std::vector<PairMatches>& matches);

  // Incremental mapping; the folders of all sub-models, none when COLMAP found no initial pair.
  // images_folder: where points get their colours from; empty: they stay black. relaxed: starts from pairs
  // with less overlap and baseline, and adds pictures on half the evidence.
  std::vector<std::filesystem::path> Map(const std::filesystem::path& images_folder,
                                         int n_pictures,
                                         bool relaxed = false);

  // The same for each of several sets of pictures, as many side by side as there are threads.
  std::vector<std::vector<std::filesystem::path>> MapBlocks(
      const std::filesystem::path& images_folder,
      const std::vector<std::vector<std::string>>& blocks,
      bool relaxed = false);

  // Adds pictures to a model of pictures of database(), whose keypoints must be those of the model; the
  // folder of the result, nothing when COLMAP could not go on.
  std::optional<std::filesystem::path> Continue(const std::filesystem::path& images_folder,
                                                const std::filesystem::path& model,
                                                int n_pictures,
                                                bool relaxed);

  // Whether the steps that follow also make points of matches that no third picture confirms.
  void TakeTwoViewTracks(bool take) { take_two_view_tracks_ = take; }

  // One model of the pictures of both, which share some; nothing when COLMAP could not align them.
  std::optional<std::filesystem::path> Merge(const std::filesystem::path& a, const std::filesystem::path& b);

  // Points for given poses, a model with the image numbers of database(); nothing when there are none.
  std::optional<std::filesystem::path> Triangulate(const std::filesystem::path& images_folder,
                                                   const std::filesystem::path& poses,
                                                   int n_pictures);

  const std::filesystem::path& database() const { return database_; }
  double cpu_s() const { return cpu_s_; }
  std::size_t peak_rss_bytes() const { return peak_rss_bytes_; }

 private:
  struct Step;
  using Blocks = std::vector<std::vector<std::string>>;

  // database: of the work of which this does a part, on another rank.
  Colmap(std::filesystem::path work_folder, int threads, std::filesystem::path database);
  std::filesystem::path SharedFolder() const { return database_.parent_path(); }
  bool Run(const Step& step);
  // A step that takes database and pictures and writes models to `output`.
  Step MapperStep(const std::string& command,
                  const std::filesystem::path& images_folder,
                  const std::filesystem::path& output,
                  int n_pictures) const;
  void CreateDatabase(const std::filesystem::path& path);
  // The folders of the models of these blocks, packed, relative to SharedFolder().
  io::TaskResults MapSome(const std::filesystem::path& images_folder,
                          const Blocks& blocks,
                          bool relaxed,
                          const std::vector<std::size_t>& tasks);

  std::filesystem::path program_, work_folder_, database_, log_path_;
  int threads_;
  std::size_t memory_bytes_;
  ColmapFlags flags_;
  bool take_two_view_tracks_ = false;
  std::mutex mutex_;  // guards the two figures below
  double cpu_s_ = 0;
  std::size_t peak_rss_bytes_ = 0;
};

}  // namespace sfm
