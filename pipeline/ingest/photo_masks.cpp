#include "pipeline/ingest/photo_masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <string>

#include "io/base/error.h"
#include "pipeline/ingest/picture_source.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
namespace fs = std::filesystem;

// Every picture of the folder by its stem.
std::map<std::string, fs::path> ListMasks(const fs::path& folder) {
  const std::string name = PrintableName(folder.string());
  const PictureSource source = FindPictures(folder);
  if (source.is_video) throw Error(ExitCode::kBadInput, name + ": holds a video, not masks");
  for (const auto& [picture, is_bad] : source.refused) {
    if (is_bad)
      throw Error(ExitCode::kBadInput, name + "/" + picture.source + ": " + picture.reason, "Make it anew");
  }
  std::map<std::string, fs::path> masks;
  for (const fs::path& file : source.files) {
    const auto [it, is_new] = masks.emplace(file.stem().string(), file);
    if (!is_new) {
      throw Error(ExitCode::kBadInput,
                  fmt::format("{}: {} and {} are masks of the same photo",
                              name,
                              PrintableName(it->second.filename().string()),
                              PrintableName(file.filename().string())),
                  "Keep one of them");
    }
  }
  return masks;
}

}  // namespace

std::vector<fs::path> MatchMasks(const fs::path& folder, const std::vector<fs::path>& photos) {
  const std::string name = PrintableName(folder.string());
  std::error_code error;
  if (!fs::is_directory(folder, error)) throw Error(ExitCode::kUsage, "--masks: " + name + " is no folder");
  const fs::path parent = photos[0].has_parent_path() ? photos[0].parent_path() : ".";
  if (fs::equivalent(folder, parent, error)) {
    throw Error(ExitCode::kUsage,
                "--masks: " + name + " is the folder of the photos",
                "Keep the masks in a folder of their own");
  }
  const std::map<std::string, fs::path> masks = ListMasks(folder);
  std::vector<fs::path> matched;
  for (const fs::path& photo : photos) {
    auto found = masks.find(photo.filename().string());
    if (found == masks.end()) found = masks.find(photo.stem().string());
    matched.push_back(found == masks.end() ? fs::path() : found->second);
  }
  if (std::all_of(matched.begin(), matched.end(), [](const fs::path& path) { return path.empty(); })) {
    throw Error(ExitCode::kBadInput,
                fmt::format("{}: none of its {} pictures is named as a photo", name, masks.size()),
                fmt::format("The mask of {} is {}.png",
                            PrintableName(photos[0].filename().string()),
                            PrintableName(photos[0].stem().string())));
  }
  return matched;
}

io::Mask ReadPhotoMask(const fs::path& path, const io::Photo& photo) {
  const std::string name = PrintableName(path.string());
  const std::string bytes = ReadPictureFile(path);
  io::Image image;
  try {
    image = io::DecodePhoto(bytes, std::numeric_limits<int>::max()).image;
  } catch (const Error& error) {
    throw Error(ExitCode::kBadInput, name + ": " + error.what());
  }
  const bool is_turned = photo.orientation >= 5;
  if (is_turned && image.width == photo.full_height && image.height == photo.full_width)
    image = io::ApplyOrientation(image, photo.orientation);
  if (image.width != photo.full_width || image.height != photo.full_height) {
    throw Error(ExitCode::kBadInput,
                fmt::format("{}: the mask is {}x{}, its photo {}x{}",
                            name,
                            image.width,
                            image.height,
                            photo.full_width,
                            photo.full_height),
                "Give masks the size of their photos");
  }
  return io::ShrinkMask(io::MaskFromImage(image), photo.image.width, photo.image.height);
}

}  // namespace pipeline
