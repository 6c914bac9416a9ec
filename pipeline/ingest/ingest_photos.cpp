// The photo half of the ingest stage.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <optional>
#include <tuple>

#include "io/base/error.h"
#include "io/image/photo.h"
#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "io/process/progress.h"
#include "pipeline/ingest/ingest.h"
#include "pipeline/ingest/lens_straightening.h"
#include "pipeline/ingest/overlay_removal.h"
#include "pipeline/ingest/panorama.h"
#include "pipeline/ingest/photo_masks.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
namespace fs = std::filesystem;

constexpr std::size_t kMinPictures = 3;  // two views fix no scene and leave none to check with
constexpr std::size_t kAdvisedPictures = 20;
constexpr std::size_t kMaxListed = 20;  // longer lists are in frames.json

// Make, model, width, height, focal length in whole pixels.
using CameraKey = std::tuple<std::string, std::string, int, int, long>;

struct PhotoResult {
  std::string reason;   // why it is dropped; empty: decoded and written
  bool is_bad = false;  // dropped because it cannot be decoded
  KeptPicture picture;
  PictureLook look;
  std::optional<double> used_share;  // of its pixels, by its mask; nothing without a mask
  std::string make, model;
};

// Decodes and writes one photo, which `picture` keeps, and its mask. A photo that cannot be decoded is
// dropped with its reason; a mask that cannot be decoded is an error, for without it the photo would be used
// whole.
void IngestPhoto(const fs::path& file,
                 const fs::path& mask_file,
                 int max_side,
                 const fs::path& folder,
                 PhotoResult* result,
                 io::Image* picture) {
  const std::string bytes = ReadPictureFile(file);
  io::Photo photo;
  try {
    photo = io::DecodePhoto(bytes, max_side);
  } catch (const Error& error) {
    result->reason = error.what();
    result->is_bad = true;
    return;
  }
  if (IsPanorama(photo.image)) {
    result->picture.is_panorama = true;
    if (photo.full_width > photo.image.width) photo = io::DecodePhoto(bytes, PanoramaWidth(max_side));
  }
  if (!mask_file.empty()) {
    const io::Mask mask = ReadPhotoMask(mask_file, photo);
    const std::size_t n_used = mask.UsedCount();
    if (n_used == 0) {
      result->reason = "its mask uses no pixel: white, grey level 128 or more, is used";
      return;
    }
    result->used_share = static_cast<double>(n_used) / static_cast<double>(mask.used.size());
    result->picture.has_mask = true;
    io::WriteMask(folder / "masks" / result->picture.name, mask);
  }
  result->look = {io::Sharpness(photo.image), io::MakeThumbnail(photo.image)};
  result->picture.width = photo.image.width;
  result->picture.height = photo.image.height;
  result->picture.sharpness = result->look.sharpness;
  result->picture.focal_px = photo.focal_px;
  result->picture.notes = photo.notes;
  result->make = photo.make;
  result->model = photo.model;
  io::WriteImage(folder / "images" / result->picture.name, photo.image);
  *picture = std::move(photo.image);
}

// The later ones of files with equal bytes get a reason.
void FindCopies(const std::vector<std::string>& hashes, std::vector<PhotoResult>* results) {
  std::map<std::string, std::string> first_with;
  for (std::size_t i = 0; i < hashes.size(); ++i) {
    PhotoResult& result = (*results)[i];
    const auto [it, is_new] = first_with.emplace(hashes[i], result.picture.source);
    if (!is_new) result.reason = "exact copy of " + it->second;
  }
}

// Throws when more files are damaged than whole: then the folder as a whole is not what the user thinks.
void RefuseMostlyBad(const std::vector<DroppedPicture>& bad, std::size_t n_whole, const std::string& folder) {
  if (bad.size() <= n_whole) return;
  throw Error(ExitCode::kBadInput,
              fmt::format("{}: {} of {} pictures cannot be used, the first being {}: {}",
                          folder,
                          bad.size(),
                          bad.size() + n_whole,
                          bad[0].source,
                          bad[0].reason),
              "Copy them again from the camera");
}

void RefuseTooFew(const Frames& frames, const std::string& folder) {
  if (frames.kept.size() >= kMinPictures) return;
  std::string why;
  if (!frames.dropped.empty()) {
    why = fmt::format(" ({} dropped, the first being {}: {})",
                      frames.dropped.size(),
                      frames.dropped[0].source,
                      frames.dropped[0].reason);
  }
  throw Error(ExitCode::kNotReconstructible,
              fmt::format("{}: {} usable picture{}{}; a scene needs at least {}",
                          folder,
                          frames.kept.size(),
                          frames.kept.size() == 1 ? "" : "s",
                          why,
                          kMinPictures),
              "Take 20 or more from positions around the object, each overlapping the last by half");
}

// Pictures of one camera at one setting share a group, so that they can share intrinsics.
int CameraGroup(const PhotoResult& result, std::map<CameraKey, int>* groups) {
  const KeptPicture& picture = result.picture;
  const long focal = std::lround(picture.focal_px.value_or(0));
  const CameraKey key(result.make, result.model, picture.width, picture.height, focal);
  return groups->emplace(key, static_cast<int>(groups->size())).first->second;
}

// Moves every result into the report, as kept or as dropped with its reason.
void Select(std::vector<PhotoResult>* results,
            const SelectionOptions& options,
            const fs::path& folder,
            IngestReport* report) {
  std::vector<PhotoResult*> decoded;
  std::vector<PictureLook> looks;
  std::vector<std::string> names;
  for (PhotoResult& result : *results) {
    if (!result.reason.empty()) continue;
    decoded.push_back(&result);
    looks.push_back(result.look);
    names.push_back(result.picture.source);
  }
  const std::vector<std::string> reasons = JudgePhotos(looks, names, options);
  for (std::size_t k = 0; k < decoded.size(); ++k) {
    decoded[k]->reason = reasons[k];
    if (reasons[k].empty()) continue;
    fs::remove(folder / "images" / decoded[k]->picture.name);
    fs::remove(folder / "masks" / decoded[k]->picture.name);
  }
  std::map<CameraKey, int> groups;
  for (PhotoResult& result : *results) {
    if (result.reason.empty()) {
      result.picture.camera_group = CameraGroup(result, &groups);
      report->frames.kept.push_back(std::move(result.picture));
    } else if (!result.is_bad) {
      report->frames.dropped.push_back({result.picture.source, result.reason});
    }
  }
  if (groups.size() > 1) {
    report->decisions.push_back(
        fmt::format("{} camera groups: the pictures differ in camera, size or focal length", groups.size()));
  }
}

// Photos that are decoded at once within the memory. Where a header does not tell a photo's size, at least
// one.
int PhotosAtOnce(const std::vector<fs::path>& files, const IngestOptions& options) {
  std::size_t largest = 0, of_unknown_size = 0;
  fs::path largest_file;
  for (const fs::path& file : files) {
    const auto [bytes, is_known] = io::CostOfDecoding(file);
    if (!is_known) {
      of_unknown_size = std::max(of_unknown_size, bytes);
    } else if (bytes > largest) {
      largest = bytes, largest_file = file;
    }
  }
  const std::size_t kept = OverlayRemoval::Bytes(files.size(), options.max_side);
  const std::string work = "ingest: " + PrintableName(largest_file.string());
  const int known = options.memory.AtOnce(options.threads, largest, kept, work);
  if (of_unknown_size <= largest) return known;
  return std::min(known, options.memory.Fits(options.threads, of_unknown_size, kept));
}

std::vector<PhotoResult> DecodeAll(const std::vector<fs::path>& files,
                                   const std::vector<std::string>& hashes,
                                   const IngestOptions& options,
                                   const fs::path& folder,
                                   OverlayRemoval* overlay) {
  const std::vector<std::string> stems = SafeStems(files);
  std::vector<PhotoResult> results(files.size());
  for (std::size_t i = 0; i < files.size(); ++i) {
    results[i].picture.name = stems[i] + ".png";
    results[i].picture.source = PrintableName(files[i].filename().string());
  }
  FindCopies(hashes, &results);

  io::Progress progress("reading photos");
  std::mutex progress_mutex;
  int n_done = 0;
  io::Workers workers(PhotosAtOnce(files, options));
  workers.Run(static_cast<int>(files.size()), [&](int i, int) {
    io::ThrowIfInterrupted();
    const auto index = static_cast<std::size_t>(i);
    PhotoResult& result = results[index];
    const fs::path mask = options.masks.empty() ? fs::path() : options.masks[index];
    if (result.reason.empty()) {
      io::Image picture;
      IngestPhoto(files[index], mask, options.max_side, folder, &result, &picture);
      if (result.reason.empty()) overlay->Look(index, result.picture.name, picture);
    }
    const std::lock_guard lock(progress_mutex);
    progress.Update(++n_done / static_cast<double>(files.size()), result.picture.source);
  });
  return results;
}

void DescribeMasks(const std::vector<PhotoResult>& results, IngestReport* report) {
  std::size_t n_masks = 0;
  double shares = 0;
  for (const PhotoResult& result : results) {
    if (!result.reason.empty()) continue;
    n_masks += result.used_share.has_value();
    shares += result.used_share.value_or(0);
  }
  const long percent = n_masks > 0 ? std::lround(100 * shares / static_cast<double>(n_masks)) : 0;
  const bool is_complete = n_masks == report->frames.kept.size();
  report->decisions.push_back(fmt::format("masks for {} of {} pictures, which use {} % of their pixels{}",
                                          n_masks,
                                          report->frames.kept.size(),
                                          percent,
                                          is_complete ? "" : "; the other pictures are used whole"));
}

void DescribeResult(IngestReport* report) {
  std::map<std::string, int> notes;
  for (const KeptPicture& picture : report->frames.kept) {
    for (const std::string& note : picture.notes) ++notes[note];
  }
  const std::size_t n_kept = report->frames.kept.size();
  const std::vector<DroppedPicture>& dropped = report->frames.dropped;
  for (const auto& [note, n] : notes) {
    report->decisions.push_back(fmt::format("{} ({} of {} pictures)", note, n, n_kept));
  }
  for (std::size_t i = 0; i < std::min(kMaxListed, dropped.size()); ++i) {
    report->decisions.push_back(fmt::format("dropped {}: {}", dropped[i].source, dropped[i].reason));
  }
  if (dropped.size() > kMaxListed) {
    report->decisions.push_back(fmt::format("dropped {} more: see frames.json", dropped.size() - kMaxListed));
  }
  if (n_kept < kAdvisedPictures) {
    report->decisions.push_back(
        fmt::format("only {} pictures: {} or more are advised", n_kept, kAdvisedPictures));
  }
}

}  // namespace

IngestReport IngestPhotos(const PictureSource& source,
                          const std::vector<std::string>& hashes,
                          const IngestOptions& options,
                          const fs::path& folder) {
  const std::vector<fs::path>& files = source.files;
  const fs::path parent = files[0].has_parent_path() ? files[0].parent_path() : ".";
  const std::string name = PrintableName(parent.string());
  OverlayRemoval overlay(files.size());
  std::vector<PhotoResult> results = DecodeAll(files, hashes, options, folder, &overlay);

  IngestReport report;
  std::vector<DroppedPicture> bad;
  std::size_t n_whole = 0;
  for (const auto& [picture, is_bad] : source.refused) {
    report.frames.dropped.push_back(picture);
    if (is_bad) bad.push_back(picture);
  }
  for (const PhotoResult& result : results) {
    n_whole += !result.is_bad;
    if (!result.is_bad) continue;
    bad.push_back({result.picture.source, result.reason});
    report.frames.dropped.push_back(bad.back());
  }
  RefuseMostlyBad(bad, n_whole, name);
  Select(&results, options.selection, folder, &report);
  RefuseTooFew(report.frames, name);
  if (!options.masks.empty()) DescribeMasks(results, &report);
  if (options.find_overlay) overlay.Apply(folder, options.threads, &report);
  if (options.find_fisheye) StraightenLenses(folder, options, &report);
  UnrollPanoramas(folder, options, &report);
  DescribeResult(&report);
  return report;
}

}  // namespace pipeline
