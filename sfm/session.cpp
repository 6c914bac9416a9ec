#include "sfm/session.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "io/process/stopwatch.h"
#include "sfm/adjust_joined.h"
#include "sfm/bundle/camera_model_selection.h"
#include "sfm/bundle/observation_sigma.h"
#include "sfm/check_options.h"
#include "sfm/choose_pairs.h"
#include "sfm/features/shared_features.h"
#include "sfm/features/stationary_matches.h"
#include "sfm/gaps.h"
#include "sfm/mapping/diagnosis.h"
#include "sfm/mapping/leaps.h"
#include "sfm/rigs.h"
#include "sfm/second_look.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

// Pictures before and after that still count as following when the order is all there is to rely on.
constexpr int kOrderOverlap = 3;
// Two parts that hang together by a few points have a hinge there: in office68 it is known to 0.5 to 0.8
// degrees. Where it is worse than this, a radiance field sees two rooms in one.
constexpr double kMaxBridgedDeg = 2;
// The model COLMAP maps with when the camera model is to be found out.
constexpr const char* kMappingModel = "SIMPLE_RADIAL";

}  // namespace

Session::Session(const std::vector<Picture>& pictures,
                 const fs::path& images_folder,
                 const fs::path& work_folder,
                 const ReconstructionOptions& options,
                 const Decide& decide)
    : pictures_(pictures),
      images_folder_(images_folder),
      work_folder_(work_folder),
      options_(options),
      decide_(decide) {
  CheckOptions(options);
  SetFeatures(std::vector<Features>(pictures.size()));
  if (n() < kMinPictures) {
    throw NotReconstructible(ExplainFailure({Summaries(views_->names, views_->features), {}}, 0));
  }
}

void Session::SetFeatures(std::vector<Features> features) {
  views_ = std::make_shared<CapturedViews>(
      CapturedViews{.names = Names(pictures_),
                    .groups = CameraGroups(pictures_),
                    .features = std::move(features),
                    .camera_model = options_.camera_model == "auto" ? kMappingModel : options_.camera_model});
}

void Session::Detect(int max_features) {
  const io::Stopwatch stopwatch;
  max_features_ = max_features;
  const FeatureOptions options{.max_features = max_features,
                               .max_image_size = options_.max_image_size,
                               .threads = options_.threads,
                               .memory = options_.memory};
  if (options_.detector == "colmap") {
    Colmap colmap(work_folder_ / "detection", options_.threads);
    SetFeatures(colmap.ExtractFeatures(images_folder_, views_->groups, views_->names, options));
    CountUse(colmap.cpu_s(), colmap.peak_rss_bytes());
  } else {
    SetFeatures(DetectOnAllRanks(images_folder_, views_->names, options_.masks_folder, options));
  }
  result_.times.features_s += stopwatch.seconds();
}

ImagePairs Session::ChoosePairs() {
  const io::Stopwatch stopwatch;
  ImagePairs pairs = sfm::ChoosePairs(pictures_, views_->features, options_, decide_);
  result_.times.matching_s += stopwatch.seconds();
  return pairs;
}

std::vector<PairMatches> Session::Match(const ImagePairs& pairs) {
  const io::Stopwatch stopwatch;
  std::vector<PairMatches> matches = MatchOnAllRanks(views_->features, pairs, options_.threads);
  comparisons_ += Comparisons(views_->features, pairs);
  result_.times.matching_s += stopwatch.seconds();
  return matches;
}

void Session::Try(std::vector<PairMatches> matches, bool relaxed) {
  const StationaryShare stationary = RemoveStationaryMatches(views_->features, &matches);
  stands_still_ |= stationary.removed > 0;
  if (stationary.removed > 0) {
    decide_(
        fmt::format("{}: removed the {:.0f} % of the matches that stand still in the picture, as in {} of {} "
                    "pairs where others move",
                    stationary.IsBackground()
                        ? "background stands still while the subject turns (turntable)"
                        : "something stands still in the picture (watermark, finger, part of the camera)",
                    100 * stationary.share,
                    stationary.split_pairs,
                    stationary.pairs));
  }
  MappingAttempt attempt = Map(views_, std::move(matches), relaxed);
  if (best_ && attempt.Registered() <= best_->Registered()) return;
  best_ = std::move(attempt);
  bridged_.clear();
  best_max_features_ = max_features_;
  result_.turntable = stationary.IsBackground();
  result_.stationary_share = stationary.share;
}

void Session::ResolveContradictions() {
  if (best_->models.empty()) return;
  const PairAgreement agreement = Agreement();
  if (!agreement.Contradicts()) return;
  decide_(agreement.Figures() + "; trying again with following pictures only");
  std::vector<PairMatches> matches = std::move(best_->matches);
  std::erase_if(matches, [](const PairMatches& pair) { return pair.b - pair.a > kOrderOverlap; });
  best_ = Map(best_->views, std::move(matches), false);
  bridged_.clear();
}

std::vector<std::string> Session::NamesOf(const std::vector<int>& pictures) const {
  std::vector<std::string> names;
  for (const int i : pictures) names.push_back(pictures_[static_cast<std::size_t>(i)].name);
  return names;
}

bool Session::InBlocks() const {
  if (options_.mapping == "auto") return n() > options_.whole_pictures && !as_a_whole_;
  return options_.mapping == "blocks";
}

bool Session::Registered(double share) const {
  std::set<std::string> posed;
  if (!best_->models.empty()) {
    for (const io::Frame& frame : best_->models.front().scene.frames) posed.insert(frame.image_path.string());
  }
  return PosedWithRigs(pictures_, posed) >= share * n();
}

Reconstruction Session::Finish() {
  if (!Registered(kMinRegisteredShare)) {
    throw NotReconstructible(ExplainFailure(best_->evidence, best_->Registered()));
  }
  result_.model = best_->models.front();
  RefuseUnusable();  // a degenerate model cannot be adjusted
  Adjust();
  RefuseUnusable();
  DropUncertainPictures();
  const RigReport rigs = JoinRigs(pictures_, "sfm: panoramas", &result_.model, &result_.uncertainty);
  if (rigs.n_rigs > 0) {
    decide_(fmt::format(
        "{} panoramas moved as wholes: {} views are posed by others of their panorama, and the rest "
        "turned by {:.2f} degrees (median)",
        rigs.n_rigs,
        rigs.n_added,
        rigs.rotation_deg));
  }
  const int n_left = static_cast<int>(result_.model.scene.frames.size());
  if (n_left < kMinRegisteredShare * n()) throw NotReconstructible(ExplainFailure(best_->evidence, n_left));
  std::vector<std::size_t> sizes;
  for (const io::ColmapModel& model : best_->models) sizes.push_back(model.scene.frames.size());
  decide_(fmt::format(
      "used the largest of {} models ({} of {} pictures)", sizes.size(), fmt::join(sizes, ", "), n()));
  std::set<std::string> registered;
  for (const io::Frame& frame : result_.model.scene.frames) registered.insert(frame.image_path.string());
  for (const Picture& picture : pictures_) {
    if (registered.count(picture.name) > 0) continue;
    const auto taken_out = taken_out_.find(picture.name);
    result_.unregistered.push_back({picture.name,
                                    taken_out == taken_out_.end()
                                        ? ExplainMissingPicture(picture.name, best_->evidence)
                                        : Refusal{RefusalCause::kMisfit, taken_out->second}});
  }
  DescribeFlatness();
  if (result_.turntable)
    decide_("turntable: poses are those of a camera around the subject, and the background contradicts them");
  const PairAgreement agreement = Agreement();
  if (agreement.Contradicts()) {
    throw NotReconstructible({RefusalCause::kContradictedPoses, agreement.Figures()});
  }
  result_.triangulation_angle_deg = MedianTriangulationAngleDeg(result_.model.scene);
  result_.database = best_->database;
  result_.log = best_->log;
  return std::move(result_);
}

MappingAttempt Session::Map(std::shared_ptr<const CapturedViews> views,
                            std::vector<PairMatches> matches,
                            bool relaxed) {
  MappingAttempt attempt = Attempt(pictures_,
                                   std::move(views),
                                   std::move(matches),
                                   images_folder_,
                                   AttemptFolder(),
                                   {.relaxed = relaxed,
                                    .adjust_joined = InBlocks() ? AdjustJoined : nullptr,
                                    .blocks = options_.blocks,
                                    .threads = options_.threads});
  CountAttempt(attempt);
  if (attempt.n_blocks > 0) {
    decide_(fmt::format("mapped in overlapping blocks, side by side: {} models, {} of them joined",
                        attempt.n_blocks,
                        attempt.n_joined));
  }
  return attempt;
}

fs::path Session::AttemptFolder() { return work_folder_ / fmt::format("attempt{}", ++n_attempts_); }

void Session::CountAttempt(const MappingAttempt& attempt) {
  result_.times.verifying_s += attempt.verifying_s;
  result_.times.mapping_s += attempt.mapping_s;
  CountUse(attempt.cpu_s, attempt.peak_rss_bytes);
}

void Session::RefuseUnusable() const {
  if (const auto refusal = JudgeModel(result_.model, best_->evidence)) throw NotReconstructible(*refusal);
}

void Session::DescribeFlatness() const {
  if (!IsFlat(result_.model.scene, best_->evidence.pairs)) return;
  const auto& groups = best_->views->groups;
  const auto unknown =
      std::count_if(groups.begin(), groups.end(), [](const CameraGroup& g) { return g.focal_px <= 0; });
  decide_(unknown == 0
              ? "one flat surface explains the picture pairs; the known focal length fixes the heights"
              : "one flat surface explains the picture pairs and the focal length is unknown: where all "
                "pictures look straight at it, distances and heights off the surface scale with the focal "
                "length assumed. Give photos with their EXIF data");
}

void Session::Adjust() {
  const io::Stopwatch stopwatch;
  CameraModelOptions options{.camera_model = options_.camera_model, .threads = options_.threads};
  std::map<std::string, double> focals;
  for (const CameraGroup& group : best_->views->groups) {
    for (const std::string& name : group.names) focals[name] = group.focal_px;
  }
  options.known_focal_px.resize(result_.model.scene.cameras.size());
  for (const io::Frame& frame : result_.model.scene.frames) {
    options.known_focal_px[static_cast<std::size_t>(frame.camera_index)] =
        focals.at(frame.image_path.string());
  }
  SetSigmas(best_->views->names, best_->views->features, &result_.model);
  result_.uncertainty = AdjustWithSelectedCameraModel(&result_.model, options, decide_).uncertainty;
  result_.times.adjusting_s += stopwatch.seconds();
}

std::set<std::string> Session::TakeOutMisfitting() {
  std::set<std::string> names;
  for (const MisfittingPicture& picture : MisfittingPictures(result_.model)) {
    names.insert(picture.name);
    TakeOut(
        picture.name,
        fmt::format("its pose hangs on {} points only, whose errors are {:.1f} times as large as in other "
                    "pictures, as those of reflections are",
                    picture.n_points,
                    picture.error_px / picture.median_px));
  }
  return names;
}

std::set<std::string> Session::TakeOutUncertain() {
  std::set<std::string> names;
  for (const UncertainPicture& picture : UncertainPictures(result_.model, result_.uncertainty)) {
    names.insert(picture.name);
    TakeOut(
        picture.name,
        fmt::format("its pose hangs on {} points and is uncertain by {:.2f} degrees, {:.0f} times as much as "
                    "those of others",
                    picture.n_points,
                    picture.rotation_deg,
                    picture.rotation_deg / picture.median_deg));
  }
  const std::set<std::string> beyond = PicturesBeyondLeaps(result_.model.scene, best_->views->names);
  if (!beyond.empty()) {
    decide_(fmt::format(
        "{} pictures taken out, {} to {}: the walk would have leapt to them, and less than a tenth "
        "of what they see is seen from elsewhere",
        beyond.size(),
        *beyond.begin(),
        *beyond.rbegin()));
    names.insert(beyond.begin(), beyond.end());
  }
  if (bridged_.empty()) return names;
  const double sigma = MedianRotationDeg(result_.model, result_.uncertainty, bridged_);
  if (sigma > kMaxBridgedDeg) {
    decide_(
        fmt::format("{} pictures taken out, because how they lie to those before the gap is uncertain by "
                    "{:.1f} degrees",
                    bridged_.size(),
                    sigma));
    names.insert(bridged_.begin(), bridged_.end());
  } else {
    decide_(
        fmt::format("pictures across the gap lie to the others as adjusted within {:.2f} degrees", sigma));
  }
  return names;
}

void Session::TakeOut(const std::string& name, const std::string& reason) {
  decide_(name + ": taken out, because " + reason);
  taken_out_[name] = reason;
}

void Session::DropUncertainPictures() {
  std::set<std::string> names = TakeOutUncertain();
  names.merge(TakeOutMisfitting());
  if (names.empty()) return;
  // From the beginning: a picture in a wrong place bends the cameras of all.
  result_.model = WithoutFrames(best_->models.front(), names);
  Adjust();
}

PairAgreement Session::Agreement() const {
  return CompareWithPairs(
      best_->models.front().scene, best_->views->names, best_->views->features, best_->evidence.pairs);
}

void Session::CountUse(double cpu_s, std::size_t peak_rss_bytes) {
  result_.colmap_cpu_s += cpu_s;
  result_.peak_rss_bytes = std::max(result_.peak_rss_bytes, peak_rss_bytes);
}

}  // namespace sfm
