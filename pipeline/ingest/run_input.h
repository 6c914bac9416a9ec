// What `pipeline run` was given, and where it enters the chain of stages.
#pragma once

#include <filesystem>
#include <string>

namespace pipeline {

struct RunInput {
  std::filesystem::path path;    // absolute; may be a glob
  std::filesystem::path poses;   // set when the input has poses: the run enters at `normalize --poses`
  std::filesystem::path images;  // the pictures of a COLMAP workspace; empty: found by `normalize`
};

// A transforms.json, or a folder that holds one (or transforms_train.json); a COLMAP model folder, or a
// folder with images/ and sparse/0 or sparse; anything else that exists, and globs, are pictures or a video.
// Throws kBadInput when nothing is there.
RunInput ExamineInput(const std::filesystem::path& input);

// "<input>.run": beside the input, without a file's extension; for a glob, beside the folder that it
// searches.
std::filesystem::path DefaultRunFolder(const std::filesystem::path& input);

}  // namespace pipeline
