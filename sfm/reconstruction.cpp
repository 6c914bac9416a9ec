#include "sfm/reconstruction.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "io/error.h"
#include "io/progress.h"
#include "sfm/colmap.h"
#include "sfm/diagnosis.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;
using io::Error;
using io::ExitCode;
using Decide = std::function<void(const std::string&)>;

// Below this, all pairs cost less than they could save.
constexpr int kMaxExhaustivePictures = 24;
// Features of largest scale that predict overlap, and pairs kept per picture.
constexpr int kPreviewFeatures = 384;
constexpr int kPartners = 14;
// Neighbours in the order of names are matched in any case: people walk.
constexpr int kPhotoOverlap = 2;
// Chosen video frames move on steadily; loops are found among the likely partners.
constexpr int kVideoOverlap = 8;
constexpr int kVideoPartners = 6;
constexpr int kRetryFeatures = 8192;
constexpr int kRetryPartners = 40;
// A model of fewer pictures is a fragment: its film would hide that the capture failed.
constexpr double kMinRegisteredShare = 0.6;

struct Attempt {
  Colmap colmap;
  CaptureEvidence evidence;
  std::vector<io::ColmapModel> models;  // largest first
  double seconds_per_pair = 0;

  int Registered() const { return models.empty() ? 0 : static_cast<int>(models.front().scene.frames.size()); }
};

double Median(std::vector<double> values) {
  std::nth_element(
      values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

// One camera per group and size: a camera shared by pictures of different sizes is refused by COLMAP.
std::vector<CameraGroup> CameraGroups(const std::vector<Picture>& pictures) {
  std::map<std::string, std::vector<const Picture*>> by_key;
  for (const Picture& picture : pictures) {
    by_key[picture.camera_group + "/" + std::to_string(picture.width) + "x" + std::to_string(picture.height)]
        .push_back(&picture);
  }
  std::vector<CameraGroup> groups;
  for (const auto& [key, members] : by_key) {
    CameraGroup group{.width = members.front()->width, .height = members.front()->height};
    std::vector<double> focals;
    for (const Picture* picture : members) {
      group.names.push_back(picture->name);
      if (picture->focal_px > 0) focals.push_back(picture->focal_px);
    }
    if (!focals.empty()) group.focal_px = Median(focals);
    groups.push_back(std::move(group));
  }
  return groups;
}

std::vector<std::string> Names(const std::vector<Picture>& pictures) {
  std::vector<std::string> names;
  for (const Picture& picture : pictures) names.push_back(picture.name);
  return names;
}

ImagePairs Union(ImagePairs a, const ImagePairs& b) {
  a.insert(b.begin(), b.end());
  return a;
}

ImagePairs ChoosePairs(const std::vector<Picture>& pictures,
                       const Colmap& colmap,
                       const ReconstructionOptions& options,
                       const Decide& decide) {
  const int n = static_cast<int>(pictures.size());
  const bool video =
      std::all_of(pictures.begin(), pictures.end(), [](const Picture& p) { return p.is_video_frame; });
  std::string way = options.matching;
  if (way == "auto") way = n <= kMaxExhaustivePictures ? "exhaustive" : video ? "sequential" : "likely";
  const std::string of_all = " of " + std::to_string(n * (n - 1) / 2) + " pairs";
  if (way == "exhaustive") {
    decide("matching all " + std::to_string(n * (n - 1) / 2) + " pairs of " + std::to_string(n) +
           " pictures");
    return AllPairs(n);
  }
  const bool sequential = way == "sequential";
  const ImagePairs likely =
      LikelyPairs(ReadLargestDescriptors(colmap.database(), Names(pictures), kPreviewFeatures),
                  sequential ? kVideoPartners : kPartners,
                  options.threads);
  const ImagePairs pairs = Union(likely, SequentialPairs(n, sequential ? kVideoOverlap : kPhotoOverlap));
  decide("matching " + std::to_string(pairs.size()) + of_all +
         (sequential ? ": following frames, and loops found by a quick comparison of the largest features"
                     : ": the most alike by a quick comparison of the largest features"));
  return pairs;
}

std::vector<io::ColmapModel> ReadModels(const std::vector<fs::path>& folders,
                                        const std::vector<Picture>& pictures) {
  std::map<std::string, const Picture*> by_name;
  for (const Picture& picture : pictures) by_name[picture.name] = &picture;
  std::vector<io::ColmapModel> models;
  for (const fs::path& folder : folders) {
    models.push_back(io::ReadColmapModel(folder));
    for (const io::Frame& frame : models.back().scene.frames) {
      const auto picture = by_name.find(frame.image_path.string());
      const io::Camera& camera = models.back().scene.cameras[static_cast<std::size_t>(frame.camera_index)];
      if (picture == by_name.end() || picture->second->width != camera.width ||
          picture->second->height != camera.height) {
        throw Error(ExitCode::kMissingTool,
                    "colmap mapper reported success but its model " + folder.string() + " holds " +
                        frame.image_path.string() +
                        ", which is not a picture of this capture or has another size");
      }
    }
  }
  std::stable_sort(models.begin(), models.end(), [](const io::ColmapModel& a, const io::ColmapModel& b) {
    return a.scene.frames.size() > b.scene.frames.size();
  });
  return models;
}

// Extracts, matches `choose_pairs` and maps. Nothing when matching hit `max_matching_s` (0: none).
std::optional<Attempt> RunAttempt(const std::vector<Picture>& pictures,
                                  const fs::path& images_folder,
                                  const fs::path& folder,
                                  const ReconstructionOptions& options,
                                  double max_matching_s,
                                  const std::function<ImagePairs(const Colmap&)>& choose_pairs) {
  Attempt attempt{.colmap = Colmap(images_folder, folder, options.threads)};
  attempt.colmap.ExtractFeatures(CameraGroups(pictures),
                                 {.max_features = options.features, .camera_model = options.camera_model});
  const ImagePairs pairs = choose_pairs(attempt.colmap);
  const auto start = std::chrono::steady_clock::now();
  if (!attempt.colmap.MatchPairs(Names(pictures), pairs, max_matching_s)) return std::nullopt;
  attempt.seconds_per_pair = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() /
                             static_cast<double>(std::max<std::size_t>(1, pairs.size()));
  attempt.models = ReadModels(attempt.colmap.Map(static_cast<int>(pictures.size())), pictures);
  attempt.evidence = {ReadFeatures(attempt.colmap.database()), ReadVerifiedPairs(attempt.colmap.database())};
  return attempt;
}

bool IsFragment(const Attempt& attempt, const std::vector<Picture>& pictures) {
  return attempt.Registered() < kMinRegisteredShare * static_cast<double>(pictures.size());
}

// A stronger setting cannot cure a capture without baseline, texture or pictures.
bool IsWorthRetrying(const std::string& cause) { return cause.rfind("no overlap", 0) == 0; }

std::optional<Attempt> Retry(const std::vector<Picture>& pictures,
                             const fs::path& images_folder,
                             const fs::path& folder,
                             const Attempt& first,
                             const ReconstructionOptions& options,
                             const Decide& decide) {
  const int n = static_cast<int>(pictures.size());
  ReconstructionOptions stronger = options;
  stronger.features = std::max(options.features, kRetryFeatures);
  const double growth = static_cast<double>(stronger.features) / options.features;
  // Comparing descriptors costs the square of their number.
  const double all_pairs_s = first.seconds_per_pair * growth * growth * n * (n - 1) / 2;
  const double ceiling_s = 60 * options.retry_minutes;
  const bool all = all_pairs_s <= ceiling_s;
  decide(
      "second attempt with up to " + std::to_string(stronger.features) + " features per picture and " +
      (all ? "all pairs" : "the " + std::to_string(kRetryPartners) + " most alike partners of each picture") +
      ", at most " + io::FormatDuration(ceiling_s) + " of matching");
  auto attempt = RunAttempt(pictures, images_folder, folder, stronger, ceiling_s, [&](const Colmap& colmap) {
    return all ? AllPairs(n)
               : Union(
                     SequentialPairs(n, kPhotoOverlap),
                     LikelyPairs(ReadLargestDescriptors(colmap.database(), Names(pictures), kPreviewFeatures),
                                 kRetryPartners,
                                 options.threads));
  });
  if (!attempt) decide("second attempt stopped at its ceiling (--retry-minutes)");
  return attempt;
}

void CheckOptions(const ReconstructionOptions& options) {
  static const std::set<std::string> kModels = {
      "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"};
  static const std::set<std::string> kWays = {"auto", "exhaustive", "likely", "sequential"};
  if (kModels.count(options.camera_model) == 0) {
    throw Error(ExitCode::kUsage,
                "--camera-model: '" + options.camera_model + "' is not supported",
                "Use SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV");
  }
  if (kWays.count(options.matching) == 0) {
    throw Error(ExitCode::kUsage,
                "--matching: '" + options.matching + "' is unknown",
                "Use auto, exhaustive, likely or sequential");
  }
  if (options.features < 100 || options.features > 32768) {
    throw Error(ExitCode::kUsage,
                "--features: " + std::to_string(options.features) + " is not in 100..32768");
  }
}

[[noreturn]] void Refuse(const std::string& cause) { throw Error(ExitCode::kNotReconstructible, cause); }

}  // namespace

Reconstruction Reconstruct(const std::vector<Picture>& pictures,
                           const fs::path& images_folder,
                           const fs::path& work_folder,
                           const ReconstructionOptions& options,
                           const Decide& decide) {
  CheckOptions(options);
  if (static_cast<int>(pictures.size()) < kMinPictures) {
    CaptureEvidence only_names;
    only_names.features.resize(pictures.size());
    Refuse(FailureCause(only_names, 0));
  }
  const std::string n_text = std::to_string(pictures.size());
  std::optional<Attempt> used =
      RunAttempt(pictures, images_folder, work_folder / "attempt1", options, 0, [&](const Colmap& colmap) {
        return ChoosePairs(pictures, colmap, options, decide);
      });
  double cpu_s = used->colmap.cpu_s();
  std::size_t peak_rss_bytes = used->colmap.peak_rss_bytes();
  if (IsFragment(*used, pictures)) {
    const std::string cause = FailureCause(used->evidence, used->Registered());
    if (!IsWorthRetrying(cause) || options.retry_minutes <= 0) Refuse(cause);
    decide("only " + std::to_string(used->Registered()) + " of " + n_text + " pictures registered");
    std::optional<Attempt> second =
        Retry(pictures, images_folder, work_folder / "attempt2", *used, options, decide);
    if (second && second->Registered() > used->Registered()) used = std::move(second);
    cpu_s += second ? second->colmap.cpu_s() : 0;
    if (second) peak_rss_bytes = std::max(peak_rss_bytes, second->colmap.peak_rss_bytes());
    if (IsFragment(*used, pictures)) Refuse(FailureCause(used->evidence, used->Registered()));
  }

  Reconstruction result;
  result.model = used->models.front();
  if (const auto cause = RefusalCause(result.model, used->evidence)) Refuse(*cause);
  std::string sizes;
  for (const io::ColmapModel& model : used->models) {
    sizes += (sizes.empty() ? "" : ", ") + std::to_string(model.scene.frames.size());
  }
  decide("used the largest of " + std::to_string(used->models.size()) + " models (" + sizes + " of " +
         n_text + " pictures)");
  std::set<std::string> registered;
  for (const io::Frame& frame : result.model.scene.frames) registered.insert(frame.image_path.string());
  for (const Picture& picture : pictures) {
    if (registered.count(picture.name) == 0) {
      result.unregistered.push_back({picture.name, UnregisteredCause(picture.name, used->evidence)});
    }
  }
  result.triangulation_angle_deg = MedianTriangulationAngleDeg(result.model.scene);
  result.database = used->colmap.database();
  result.sparse_folder = result.database.parent_path() / "sparse";
  result.log = result.database.parent_path() / "colmap.log";
  result.cpu_s = cpu_s;
  result.peak_rss_bytes = peak_rss_bytes;
  return result;
}

}  // namespace sfm
