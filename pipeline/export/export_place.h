// Where exports go, and what they may replace: a folder must be new, empty or an earlier export; a file must
// be new or an earlier export, unless the user insists. Nothing goes into the run folder.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/export/target_frame.h"

namespace pipeline {

// In the head of every file that we write, which tells it from those of others; as a comment line of PLY.
inline constexpr char kExportMark[] = "written by pipeline export";
inline constexpr char kExportComment[] = "comment written by pipeline export\n";

// Throws kBadInput or kUsage when `file` may not be written, naming the rule. extensions: ".ply", one of
// them.
void RequireExportFile(const std::filesystem::path& file,
                       const std::vector<std::string>& extensions,
                       const std::filesystem::path& run_folder,
                       bool force);
void RequireExportFolder(const std::filesystem::path& folder, const std::filesystem::path& run_folder);

// Without "." and "..", and without a slash at its end, which would follow a link.
std::filesystem::path AbsolutePath(const std::filesystem::path& path);

// Whether `path` is `folder` or would lie in it, symbolic links resolved as far as the paths exist.
bool IsWithin(const std::filesystem::path& path, const std::filesystem::path& folder);

// A folder that appears under its name when it is complete.
class ExportFolder {
 public:
  explicit ExportFolder(const std::filesystem::path& target);
  ~ExportFolder();  // removes what was not committed
  ExportFolder(const ExportFolder&) = delete;
  ExportFolder& operator=(const ExportFolder&) = delete;

  const std::filesystem::path& path() const { return partial_; }  // write here
  // Writes export.json, which says what the folder is and in which frame, and replaces the earlier export.
  void Commit(const std::string& kind, const TargetFrame& frame);

 private:
  const std::filesystem::path target_, partial_;
};

}  // namespace pipeline
