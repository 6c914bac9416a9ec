#include "pipeline/export/export_place.h"

#include <fmt/ranges.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"
#include "io/base/owned_folder.h"
#include "pipeline/stage/versions.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Error;
using io::ExitCode;
using io::Json;

constexpr char kRecord[] = "export.json";
constexpr char kPartial[] = ".partial";
constexpr std::size_t kHeadBytes = 4096;  // glTF lists its numbers before who wrote it

void RequireOutside(const fs::path& target, const fs::path& run_folder) {
  if (IsWithin(target, run_folder) || IsWithin(run_folder, target))
    throw Error(ExitCode::kUsage,
                target.string() + ": lies in the run folder, or holds it",
                "Choose a place beside it");
}

// Before any work: whether `target` can be made.
void RequireWritablePlace(const fs::path& target) {
  fs::path folder = AbsolutePath(target).parent_path();
  while (!fs::exists(folder)) folder = folder.parent_path();
  if (!fs::is_directory(folder) || access(folder.c_str(), W_OK | X_OK) != 0)
    throw Error(ExitCode::kBadInput,
                target.string() + ": cannot be made in " + folder.string(),
                "Choose a folder that you may write to");
}

[[noreturn]] void RefuseToReplace(const fs::path& target, const std::string& remedy) {
  throw Error(ExitCode::kBadInput, target.string() + ": was not written by `pipeline export`", remedy);
}

bool IsOurFile(const fs::path& file) {
  std::string head(kHeadBytes, '\0');
  std::ifstream(file, std::ios::binary).read(head.data(), static_cast<std::streamsize>(head.size()));
  return head.find(kExportMark) != std::string::npos;
}

// What killed exports to this target left; those of living processes stay.
void RemoveStale(const fs::path& target) {
  const std::string prefix = "." + target.filename().string() + ".";
  for (const auto& entry : fs::directory_iterator(target.parent_path())) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix) || !name.ends_with(kPartial)) continue;
    char* end = nullptr;
    const long process = std::strtol(name.c_str() + prefix.size(), &end, 10);
    if (process > 0 && end == name.c_str() + name.size() - std::strlen(kPartial) &&
        kill(static_cast<pid_t>(process), 0) != 0 && errno == ESRCH)
      io::RemoveOwnedFolder(entry.path());
  }
}

fs::path PartialOf(const fs::path& target) {
  return target.parent_path() /
         ("." + target.filename().string() + "." + std::to_string(getpid()) + kPartial);
}

}  // namespace

fs::path AbsolutePath(const fs::path& path) {
  return fs::absolute(path / "").lexically_normal().parent_path();
}

bool IsWithin(const fs::path& path, const fs::path& folder) {
  const fs::path relative =
      fs::weakly_canonical(AbsolutePath(path)).lexically_relative(fs::weakly_canonical(AbsolutePath(folder)));
  return !relative.empty() && *relative.begin() != "..";
}

void RequireExportFile(const fs::path& file,
                       const std::vector<std::string>& extensions,
                       const fs::path& run_folder,
                       bool force) {
  RequireOutside(file, run_folder);
  RequireWritablePlace(file);
  if (std::find(extensions.begin(), extensions.end(), file.extension()) == extensions.end())
    throw Error(ExitCode::kUsage,
                fmt::format("{}: is not named {}", file.string(), fmt::join(extensions, " or ")),
                "Choose such a name");
  if (!fs::exists(fs::symlink_status(file))) return;
  if (!fs::is_regular_file(file)) RefuseToReplace(file, "It is no file: choose another name");
  if (!force && !IsOurFile(file)) RefuseToReplace(file, "Choose another name, or --force");
}

void RequireExportFolder(const fs::path& folder, const fs::path& run_folder) {
  RequireOutside(folder, run_folder);
  RequireWritablePlace(folder);
  const fs::path target = AbsolutePath(folder);  // without a slash that would follow a link
  const fs::file_status status = fs::symlink_status(target);
  if (!fs::exists(status)) return;
  const bool is_ours =
      fs::is_directory(status) && (fs::is_empty(target) || (fs::is_regular_file(target / io::kFolderMarker) &&
                                                            fs::is_regular_file(target / kRecord)));
  if (!is_ours) RefuseToReplace(folder, "Choose a new or an empty folder");
}

ExportFolder::ExportFolder(const fs::path& target)
    : target_(AbsolutePath(target)), partial_(PartialOf(target_)) {
  fs::create_directories(target_.parent_path());
  RemoveStale(target_);
  io::RecreateOwnedFolder(partial_);
}

ExportFolder::~ExportFolder() {
  try {
    io::RemoveOwnedFolder(partial_);
  } catch (const std::exception&) {  // the error that brought us here is the one to report
  }
}

void ExportFolder::Commit(const std::string& kind, const TargetFrame& frame) {
  const io::Sim3d& sim3 = frame.target_from_scene;
  Json rotation = Json::array();
  for (int r = 0; r < 3; ++r)
    rotation.push_back({sim3.rotation(r, 0), sim3.rotation(r, 1), sim3.rotation(r, 2)});
  const Json record = {
      {"export", kind},
      {"frame", frame.name},
      {"unit", frame.unit},
      {"target_from_scene",
       {{"scale", sim3.scale},
        {"rotation", rotation},
        {"translation", {sim3.translation.x(), sim3.translation.y(), sim3.translation.z()}}}},
      {"versions", VersionsJson()}};
  io::WriteFileAtomically(partial_ / kRecord, io::DumpJson(record, 1) + "\n");
  io::ReplaceFolder(partial_, target_);
}

}  // namespace pipeline
