// The ingest stage: a user's photos or video become clean pictures in <run>/ingest/images, their masks in
// <run>/ingest/masks, and a list of what was kept, what was dropped, and why.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/ingest/picture_selection.h"
#include "pipeline/ingest/picture_source.h"

namespace pipeline {

// `pipeline ingest`; returns the process's exit code and never throws.
int RunIngest(int argc, const char* const* argv);

struct IngestOptions {
  std::vector<std::filesystem::path> masks;  // of each photo (MatchMasks), or none at all
  int max_side = 1600;  // longest side of the kept pictures [px]; smaller ones are not enlarged
  int first_frame = 0;  // of a video
  int last_frame = -1;  // inclusive; -1: to the end
  int threads = 1;
  SelectionOptions selection;
};

struct KeptPicture {
  std::string name;    // file name in images/
  std::string source;  // printable name of the user's file, or "frame 17"
  int width = 0, height = 0;
  double sharpness = 0;              // io::Sharpness
  std::optional<double> focal_px;    // from EXIF, for width x height
  std::optional<double> used_share;  // of its pixels, by its mask; nothing without a mask
  int camera_group = 0;              // pictures with equal numbers come from one camera and setting
  std::optional<double> time_s;      // in the video
  std::vector<std::string> notes;
};

struct IngestReport {
  std::vector<KeptPicture> kept;
  std::vector<DroppedPicture> dropped;
  std::vector<std::string> decisions;  // lines for the user
};

// Write the kept pictures as PNG into folder/images, and the masks of those that have one, under the same
// name, into folder/masks. Throw kBadInput when the input or a mask is damaged, kNotReconstructible when too
// little is left.
IngestReport IngestPhotos(const PictureSource& source,
                          const IngestOptions& options,
                          const std::filesystem::path& folder);
IngestReport IngestVideo(const std::filesystem::path& video,
                         const IngestOptions& options,
                         const std::filesystem::path& folder);

}  // namespace pipeline
