// Durable writes: a name on disk is either the old file or the complete new one, never a mixture.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace io {

// Writes to a temporary name in the same folder, checks every write, syncs file and folder, and renames.
// Parent folders are created. Throws kNoResources with the number of bytes needed.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes);
// The same for a file whose parts lie in several places.
void WriteFileAtomically(const std::filesystem::path& path, std::span<const std::string_view> parts);

// Removes what killed writers left below `folder`. Call it only where nobody else writes.
void RemoveTemporaries(const std::filesystem::path& folder);

// Flushes every file and folder below `folder` and renames it to `target`, replacing a folder of ours that
// stood there (owned_folder.h). After a crash `target` is the old folder or the new one; the old one may be
// left under the name `folder`. (On file systems that cannot exchange two names, such as NFS, `target` is
// missing for a moment.) Throws kBadInput when `target` is not ours, kNoResources.
void ReplaceFolder(const std::filesystem::path& folder, const std::filesystem::path& target);

// The whole file; throws kBadInput when it cannot be read or exceeds `max_bytes`.
std::string ReadFile(const std::filesystem::path& path, std::size_t max_bytes = std::size_t{1} << 30);

}  // namespace io
