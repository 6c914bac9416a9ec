// Which files a user meant by INPUT: a folder, a pattern, a video or a single picture. Nothing is opened that
// could block, lead elsewhere, or is not what it claims to be.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/stage/frames.h"

namespace pipeline {

struct RefusedFile {
  DroppedPicture picture;
  bool is_bad = false;  // it claimed to be a picture and cannot be used
};

struct PictureSource {
  bool is_video = false;                     // then `files` holds the video alone
  std::vector<std::filesystem::path> files;  // regular files that start as a picture does; natural order
  std::vector<RefusedFile> refused;          // everything else that was found
};

// input: a folder (its own files only), a pattern (*, ?, [...]) or a file. Throws kBadInput when there is
// nothing to read, naming the input and what is accepted.
PictureSource FindPictures(const std::filesystem::path& input);

// The whole file. Throws kBadInput when it cannot be read or changes meanwhile.
std::string ReadPictureFile(const std::filesystem::path& path);

// Valid UTF-8 without control characters: other bytes become \xNN.
std::string PrintableName(const std::string& name);

// One stem per file, in order: the original stem with everything outside [A-Za-z0-9._-] replaced by '_', and
// a number behind it where two would differ in nothing or in case only. Safe for COLMAP, JSON and any shell.
std::vector<std::string> SafeStems(const std::vector<std::filesystem::path>& files);

}  // namespace pipeline
