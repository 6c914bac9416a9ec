// Folders that this program writes bear a marker; only what bears it is ever replaced or removed.
#pragma once

#include <filesystem>

namespace io {

// Name of the marker, a file that says in its text what it stands for.
inline constexpr char kFolderMarker[] = ".pipeline-folder";

// Makes `folder` ours: creates it where there is none, and marks it when it is empty. Throws kBadInput when
// it holds files but no marker, kUsage when it is not a folder and none can be created.
void ClaimFolder(const std::filesystem::path& folder);

// Throws kBadInput unless `folder` is absent, or a real folder (not a symbolic link) that is empty or marked.
void RequireOwnedFolder(const std::filesystem::path& folder);

// Removes a folder of ours with all it holds; no-op when absent. Throws as RequireOwnedFolder does.
void RemoveOwnedFolder(const std::filesystem::path& folder);

// The same, and then an empty one that is ours.
void RecreateOwnedFolder(const std::filesystem::path& folder);

}  // namespace io
