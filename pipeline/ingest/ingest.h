// The ingest stage: a user's photos or video become clean pictures in <run>/ingest/images, their masks in
// <run>/ingest/masks, and a list of what was kept, what was dropped, and why.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/base/memory.h"
#include "pipeline/ingest/picture_selection.h"
#include "pipeline/ingest/picture_source.h"
#include "pipeline/stage/frames.h"

namespace pipeline {

// `pipeline ingest`; returns the process's exit code and never throws.
int RunIngest(int argc, const char* const* argv);

struct IngestOptions {
  std::vector<std::filesystem::path> masks;  // of each photo (MatchMasks), or none at all
  int max_side = 1600;       // longest side of the kept pictures [px]; smaller ones are not enlarged
  int first_frame = 0;       // of a video
  int last_frame = -1;       // inclusive; -1: to the end
  bool find_overlay = true;  // leave out what lies over every picture (overlay.h)
  bool find_fisheye = true;  // straighten what a strongly curved lens shows (lens_straightening.h)
  int threads = 1;
  io::MemoryBudget memory = io::MemoryBudget();  // fewer photos are decoded at once where it is short
  SelectionOptions selection;
};

struct IngestReport {
  Frames frames;
  std::vector<std::string> decisions;  // lines for the user
};

// Write the kept pictures as PNG into folder/images, and the masks of those that have one, under the same
// name, into folder/masks. hashes: of each photo's content, in order; equal ones are copies. Throw kBadInput
// when the input or a mask is damaged, kNotReconstructible when too little is left,
// kNoResources when the memory does not suffice for one picture.
IngestReport IngestPhotos(const PictureSource& source,
                          const std::vector<std::string>& hashes,
                          const IngestOptions& options,
                          const std::filesystem::path& folder);
IngestReport IngestVideo(const std::filesystem::path& video,
                         const IngestOptions& options,
                         const std::filesystem::path& folder);

}  // namespace pipeline
