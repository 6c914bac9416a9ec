#include "sfm/reconstruction.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "io/base/error.h"
#include "io/base/progress.h"
#include "io/base/stopwatch.h"
#include "sfm/bundle/camera_model_selection.h"
#include "sfm/bundle/observation_sigma.h"
#include "sfm/features/likely_pairs.h"
#include "sfm/features/stationary_matches.h"
#include "sfm/mapping/colmap.h"
#include "sfm/mapping/diagnosis.h"
#include "sfm/mapping/mapping_attempt.h"
#include "sfm/mapping/pair_agreement.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;
using io::Error;
using io::ExitCode;
using Decide = std::function<void(const std::string&)>;

// Matching a pair takes 14 ms of one core, verifying it 5 ms, but 70 ms where most matches are wrong: up to
// here all pairs cost seconds. 60 photos took 125 s with all pairs, 75 photos 75 s with the likely ones.
constexpr int kMaxExhaustivePictures = 30;
// Partners kept per picture beyond that.
constexpr int kPartners = 20;
// Neighbours in the order of names are matched in any case: people walk.
constexpr int kPhotoOverlap = 2;
// Chosen video frames move on steadily; loops are found among the likely partners.
constexpr int kVideoOverlap = 8;
constexpr int kVideoPartners = 8;
constexpr int kRetryFeatures = 8192;
// Further attempts are made while fewer pictures than this are registered.
constexpr double kGoodRegisteredShare = 0.9;
// A model of fewer pictures is a fragment: its film would hide that the capture failed.
constexpr double kMinRegisteredShare = 0.6;
// Good captures reach 0.07 (repeated texture far apart), and nothing between following pictures; folded
// models begin at 0.16 and 0.19.
constexpr double kMaxContradictingShare = 0.15, kMaxFollowingContradictingShare = 0.1;
// Pictures before and after that still count as following when the order is all there is to rely on.
constexpr int kOrderOverlap = 3;
// The model COLMAP maps with when the camera model is to be found out.
constexpr const char* kMappingModel = "SIMPLE_RADIAL";

[[noreturn]] void Refuse(const std::string& cause) { throw Error(ExitCode::kNotReconstructible, cause); }

void CheckChoice(const std::string& flag, const std::string& value, const std::set<std::string>& choices) {
  if (choices.count(value) > 0) return;
  std::string list;
  for (const std::string& choice : choices) list += (list.empty() ? "" : ", ") + choice;
  throw Error(ExitCode::kUsage, flag + ": '" + value + "' is unknown", "Use one of: " + list);
}

void CheckOptions(const ReconstructionOptions& options) {
  CheckChoice("--camera-model",
              options.camera_model,
              {"auto", "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"});
  CheckChoice("--matching", options.matching, {"auto", "exhaustive", "likely", "sequential"});
  CheckChoice("--detector", options.detector, {"opencv", "colmap"});
  if (options.features < 100 || options.features > 16384) {
    throw Error(ExitCode::kUsage,
                "--features: " + std::to_string(options.features) + " is not in 100..16384");
  }
}

// The work on one capture: what is known so far, and the attempts made with it.
class Session {
 public:
  Session(const std::vector<Picture>& pictures,
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
    if (n() < kMinPictures) Refuse(FailureCause({Summaries(views_->names, views_->features), {}}, 0));
  }

  void SetFeatures(std::vector<Features> features) {
    views_ = std::make_shared<CapturedViews>(CapturedViews{
        .names = Names(pictures_),
        .groups = CameraGroups(pictures_),
        .features = std::move(features),
        .camera_model = options_.camera_model == "auto" ? kMappingModel : options_.camera_model});
  }

  void Detect(int max_features) {
    const io::Stopwatch stopwatch;
    const FeatureOptions options{
        .max_features = max_features, .max_image_size = options_.max_image_size, .threads = options_.threads};
    if (options_.detector == "colmap") {
      Colmap colmap(work_folder_ / "detection", options_.threads);
      SetFeatures(colmap.ExtractFeatures(images_folder_, views_->groups, views_->names, options));
      CountUse(colmap.cpu_s(), colmap.peak_rss_bytes());
    } else {
      SetFeatures(DetectFeatures(images_folder_, views_->names, options_.masks_folder, options));
    }
    result_.times.features_s += stopwatch.seconds();
  }

  ImagePairs ChoosePairs() {
    const bool video =
        std::all_of(pictures_.begin(), pictures_.end(), [](const Picture& p) { return p.is_video_frame; });
    std::string way = options_.matching;
    if (way == "auto") way = n() <= kMaxExhaustivePictures ? "exhaustive" : video ? "sequential" : "likely";
    const std::string all = std::to_string(n() * (n() - 1) / 2);
    if (way == "exhaustive") {
      decide_("matching all " + all + " pairs of " + std::to_string(n()) + " pictures");
      return AllPairs(n());
    }
    const bool sequential = way == "sequential";
    const io::Stopwatch stopwatch;
    ImagePairs pairs =
        LikelyPairs(views_->features, sequential ? kVideoPartners : kPartners, options_.threads);
    pairs.merge(SequentialPairs(n(), sequential ? kVideoOverlap : kPhotoOverlap));
    result_.times.matching_s += stopwatch.seconds();
    decide_("matching " + std::to_string(pairs.size()) + " of " + all + " pairs" +
            (sequential ? ": following frames, and loops found by a quick comparison of the largest features"
                        : ": the most alike by a quick comparison of the largest features"));
    return pairs;
  }

  std::vector<PairMatches> Match(const ImagePairs& pairs) {
    const io::Stopwatch stopwatch;
    std::vector<PairMatches> matches = MatchFeatures(views_->features, pairs, options_.threads);
    result_.times.matching_s += stopwatch.seconds();
    return matches;
  }

  // Keeps the attempt when it registers more pictures than the best so far.
  void Try(std::vector<PairMatches> matches, bool relaxed) {
    const StationaryShare stationary = RemoveStationaryMatches(views_->features, &matches);
    if (stationary.removed > 0) {
      decide_("removed " + std::to_string(stationary.removed) +
              " matches that stand still in the picture: in " + std::to_string(stationary.split_pairs) +
              " of " + std::to_string(stationary.pairs) +
              " pairs the subject moves against its background (turntable, watermark)");
    }
    MappingAttempt attempt = Map(views_, std::move(matches), relaxed);
    if (!best_ || attempt.Registered() > best_->Registered()) best_ = std::move(attempt);
  }

  // Where pairs contradict the model, places that look alike may have been taken for one. Neighbours in the
  // order of the pictures are the pairs least likely to be mistaken.
  void ResolveContradictions() {
    if (best_->models.empty() || !Contradicts()) return;
    decide_(Contradiction() + "; trying again with following pictures only");
    std::vector<PairMatches> matches = std::move(best_->matches);
    std::erase_if(matches, [](const PairMatches& pair) { return pair.b - pair.a > kOrderOverlap; });
    best_ = Map(best_->views, std::move(matches), false);
  }

  bool Registered(double share) const { return best_->Registered() >= share * n(); }

  // Stronger settings, cheapest first, within a ceiling of time.
  void ClimbLadder(std::vector<PairMatches> matches, std::size_t n_pairs) {
    const io::Stopwatch stopwatch;
    const double ceiling_s = 60 * options_.retry_minutes;
    const std::size_t all = static_cast<std::size_t>(n()) * (n() - 1) / 2;
    const double all_over_now =
        static_cast<double>(all) / static_cast<double>(std::max<std::size_t>(1, n_pairs));
    const double growth = static_cast<double>(kRetryFeatures) / options_.features;
    const ReconstructionTimes& t = result_.times;
    const double pairs_s = t.matching_s + t.verifying_s, mapping_s = t.mapping_s, features_s = t.features_s;
    struct Rung {
      std::string text;
      double estimate_s;
      std::function<void()> climb;
    };
    std::vector<Rung> rungs;
    rungs.push_back({"a relaxed start and half the evidence per picture", pairs_s + mapping_s, [&] {
                       Try(matches, true);
                     }});
    if (n_pairs < all) {
      rungs.push_back({"all " + std::to_string(all) + " pairs", pairs_s * all_over_now + mapping_s, [&] {
                         matches = Match(AllPairs(n()));
                         Try(matches, true);
                       }});
    }
    if (options_.features < kRetryFeatures) {
      // Comparing descriptors costs the square of their number.
      rungs.push_back({"up to " + std::to_string(kRetryFeatures) + " features per picture and all pairs",
                       features_s + pairs_s * all_over_now * growth * growth + mapping_s * growth,
                       [&] {
                         Detect(kRetryFeatures);
                         Try(Match(AllPairs(n())), true);
                       }});
    }
    for (const Rung& rung : rungs) {
      if (Registered(kGoodRegisteredShare)) return;
      const std::string cause = FailureCause(best_->evidence, best_->Registered());
      // A stronger setting cannot cure a capture without baseline, texture or pictures.
      const bool curable = cause.starts_with("no overlap") || cause.starts_with("no consistent model");
      if (!Registered(kMinRegisteredShare) && !curable) return;
      const std::string so_far = "only " + std::to_string(best_->Registered()) + " of " +
                                 std::to_string(n()) + " pictures registered; ";
      if (stopwatch.seconds() + rung.estimate_s > ceiling_s) {
        decide_(so_far + "not tried: " + rung.text + ", about " + io::FormatDuration(rung.estimate_s) +
                " (--retry-minutes)");
        continue;
      }
      decide_(so_far + "trying again with " + rung.text);
      rung.climb();
    }
  }

  Reconstruction Finish() {
    if (!Registered(kMinRegisteredShare)) Refuse(FailureCause(best_->evidence, best_->Registered()));
    result_.model = best_->models.front();
    RefuseUnusable();  // a degenerate model cannot be adjusted
    Adjust();
    RefuseUnusable();
    std::string sizes;
    for (const io::ColmapModel& model : best_->models) {
      sizes += (sizes.empty() ? "" : ", ") + std::to_string(model.scene.frames.size());
    }
    decide_("used the largest of " + std::to_string(best_->models.size()) + " models (" + sizes + " of " +
            std::to_string(n()) + " pictures)");
    std::set<std::string> registered;
    for (const io::Frame& frame : result_.model.scene.frames) registered.insert(frame.image_path.string());
    for (const Picture& picture : pictures_) {
      if (registered.count(picture.name) > 0) continue;
      result_.unregistered.push_back({picture.name, UnregisteredCause(picture.name, best_->evidence)});
    }
    if (Contradicts()) {
      Refuse("no consistent model: " + Contradiction() +
             "; the scene repeats itself or moves: mask what moves, or take pictures in closer order");
    }
    result_.triangulation_angle_deg = MedianTriangulationAngleDeg(result_.model.scene);
    result_.database = best_->database;
    result_.log = best_->log;
    return std::move(result_);
  }

 private:
  int n() const { return static_cast<int>(pictures_.size()); }

  MappingAttempt Map(std::shared_ptr<const CapturedViews> views,
                     std::vector<PairMatches> matches,
                     bool relaxed) {
    const fs::path folder = work_folder_ / ("attempt" + std::to_string(++n_attempts_));
    MappingAttempt attempt = Attempt(
        pictures_, std::move(views), std::move(matches), images_folder_, folder, relaxed, options_.threads);
    result_.times.verifying_s += attempt.verifying_s;
    result_.times.mapping_s += attempt.mapping_s;
    CountUse(attempt.cpu_s, attempt.peak_rss_bytes);
    return attempt;
  }

  void RefuseUnusable() const {
    if (const auto cause = RefusalCause(result_.model, best_->evidence)) Refuse(*cause);
  }

  void Adjust() {
    const io::Stopwatch stopwatch;
    CameraChoiceOptions options{.camera_model = options_.camera_model};
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
    result_.uncertainty = AdjustWithNeededCamera(&result_.model, options, decide_).uncertainty;
    result_.times.adjusting_s += stopwatch.seconds();
  }

  PairAgreement Agreement() const {
    return CompareWithPairs(
        best_->models.front().scene, best_->views->names, best_->views->features, best_->evidence.pairs);
  }

  bool Contradicts() const {
    const PairAgreement agreement = Agreement();
    return agreement.contradicting_share > kMaxContradictingShare ||
           agreement.following_contradicting_share > kMaxFollowingContradictingShare;
  }

  std::string Contradiction() const {
    const PairAgreement agreement = Agreement();
    return std::to_string(std::lround(100 * agreement.contradicting_share)) + " % of all matches and " +
           std::to_string(std::lround(100 * agreement.following_contradicting_share)) +
           " % of those between following pictures contradict the poses found (" +
           std::to_string(agreement.contradicting) + " of " + std::to_string(agreement.pairs) + " pairs)";
  }

  void CountUse(double cpu_s, std::size_t peak_rss_bytes) {
    result_.colmap_cpu_s += cpu_s;
    result_.peak_rss_bytes = std::max(result_.peak_rss_bytes, peak_rss_bytes);
  }

  const std::vector<Picture>& pictures_;
  fs::path images_folder_, work_folder_;
  const ReconstructionOptions& options_;
  const Decide& decide_;
  std::shared_ptr<const CapturedViews> views_;  // with the latest features
  std::optional<MappingAttempt> best_;
  int n_attempts_ = 0;
  Reconstruction result_;
};

}  // namespace

Reconstruction Reconstruct(const std::vector<Picture>& pictures,
                           const fs::path& images_folder,
                           const fs::path& work_folder,
                           const ReconstructionOptions& options,
                           const Decide& decide) {
  Session session(pictures, images_folder, work_folder, options, decide);
  session.Detect(options.features);
  const ImagePairs pairs = session.ChoosePairs();
  std::vector<PairMatches> matches = session.Match(pairs);
  session.Try(matches, false);
  if (options.retry_minutes > 0) session.ClimbLadder(matches, pairs.size());
  session.ResolveContradictions();
  return session.Finish();
}

Reconstruction ReconstructMatches(const std::vector<Picture>& pictures,
                                  const std::vector<Features>& features,
                                  const std::vector<PairMatches>& matches,
                                  const fs::path& work_folder,
                                  const ReconstructionOptions& options,
                                  const Decide& decide) {
  Session session(pictures, "", work_folder, options, decide);
  session.SetFeatures(features);
  session.Try(matches, false);
  session.ResolveContradictions();
  return session.Finish();
}

}  // namespace sfm
