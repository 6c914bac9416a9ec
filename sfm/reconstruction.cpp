#include "sfm/reconstruction.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "io/base/progress.h"
#include "io/base/stopwatch.h"
#include "sfm/bundle/camera_model_selection.h"
#include "sfm/bundle/observation_sigma.h"
#include "sfm/check_options.h"
#include "sfm/choose_pairs.h"
#include "sfm/features/stationary_matches.h"
#include "sfm/mapping/colmap.h"
#include "sfm/mapping/diagnosis.h"
#include "sfm/mapping/mapping_attempt.h"
#include "sfm/mapping/pair_agreement.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;
using Decide = std::function<void(const std::string&)>;

constexpr int kRetryFeatures = 8192;
// Further attempts are made while fewer pictures than this are registered.
constexpr double kGoodRegisteredShare = 0.9;
// A model of fewer pictures is a fragment: its film would hide that the capture failed.
constexpr double kMinRegisteredShare = 0.6;
// Pictures before and after that still count as following when the order is all there is to rely on.
constexpr int kOrderOverlap = 3;
// The model COLMAP maps with when the camera model is to be found out.
constexpr const char* kMappingModel = "SIMPLE_RADIAL";

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
    if (n() < kMinPictures) {
      throw NotReconstructible(ExplainFailure({Summaries(views_->names, views_->features), {}}, 0));
    }
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
    const io::Stopwatch stopwatch;
    ImagePairs pairs = sfm::ChoosePairs(pictures_, views_->features, options_, decide_);
    result_.times.matching_s += stopwatch.seconds();
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
      decide_(fmt::format(
          "removed {} matches that stand still in the picture: in {} of {} pairs the subject moves "
          "against its background (turntable, watermark)",
          stationary.removed,
          stationary.split_pairs,
          stationary.pairs));
    }
    MappingAttempt attempt = Map(views_, std::move(matches), relaxed);
    if (!best_ || attempt.Registered() > best_->Registered()) best_ = std::move(attempt);
  }

  // Where pairs contradict the model, places that look alike may have been taken for one. Neighbours in the
  // order of the pictures are the pairs least likely to be mistaken.
  void ResolveContradictions() {
    if (best_->models.empty()) return;
    const PairAgreement agreement = Agreement();
    if (!agreement.Contradicts()) return;
    decide_(agreement.Figures() + "; trying again with following pictures only");
    std::vector<PairMatches> matches = std::move(best_->matches);
    std::erase_if(matches, [](const PairMatches& pair) { return pair.b - pair.a > kOrderOverlap; });
    best_ = Map(best_->views, std::move(matches), false);
  }

  bool Registered(double share) const { return best_->Registered() >= share * n(); }

  // Maps again with stronger settings while too few pictures are registered, within a ceiling of time.
  void TryStrongerSettings(const std::vector<PairMatches>& matches, std::size_t n_pairs) {
    const io::Stopwatch stopwatch;
    for (const StrongerSetting& setting : StrongerSettings(matches, n_pairs)) {
      if (Registered(kGoodRegisteredShare)) return;
      const RefusalCause cause = ExplainFailure(best_->evidence, best_->Registered()).cause;
      // A stronger setting cannot cure a capture without baseline, texture or pictures.
      const bool curable = cause == RefusalCause::kNoOverlap || cause == RefusalCause::kMisfit;
      if (!Registered(kMinRegisteredShare) && !curable) return;
      const std::string so_far = fmt::format("only {} of {} pictures registered; ", best_->Registered(), n());
      if (stopwatch.seconds() + setting.estimate_s > 60 * options_.retry_minutes) {
        decide_(so_far + fmt::format("not tried: {}, about {} (--retry-minutes)",
                                     setting.text,
                                     io::FormatDuration(setting.estimate_s)));
        continue;
      }
      decide_(so_far + "trying again with " + setting.text);
      setting.attempt();
    }
  }

  Reconstruction Finish() {
    if (!Registered(kMinRegisteredShare)) {
      throw NotReconstructible(ExplainFailure(best_->evidence, best_->Registered()));
    }
    result_.model = best_->models.front();
    RefuseUnusable();  // a degenerate model cannot be adjusted
    Adjust();
    RefuseUnusable();
    std::vector<std::size_t> sizes;
    for (const io::ColmapModel& model : best_->models) sizes.push_back(model.scene.frames.size());
    decide_(fmt::format(
        "used the largest of {} models ({} of {} pictures)", sizes.size(), fmt::join(sizes, ", "), n()));
    std::set<std::string> registered;
    for (const io::Frame& frame : result_.model.scene.frames) registered.insert(frame.image_path.string());
    for (const Picture& picture : pictures_) {
      if (registered.count(picture.name) > 0) continue;
      result_.unregistered.push_back({picture.name, ExplainMissingPicture(picture.name, best_->evidence)});
    }
    DescribeFlatness();
    const PairAgreement agreement = Agreement();
    if (agreement.Contradicts()) {
      throw NotReconstructible({RefusalCause::kContradictedPoses, agreement.Figures()});
    }
    result_.triangulation_angle_deg = MedianTriangulationAngleDeg(result_.model.scene);
    result_.database = best_->database;
    result_.log = best_->log;
    return std::move(result_);
  }

 private:
  struct StrongerSetting {
    std::string text;
    double estimate_s;
    std::function<void()> attempt;
  };

  int n() const { return static_cast<int>(pictures_.size()); }

  // Cheapest first; `matches` are those of the `n_pairs` pairs tried so far.
  std::vector<StrongerSetting> StrongerSettings(const std::vector<PairMatches>& matches,
                                                std::size_t n_pairs) {
    const std::size_t all = static_cast<std::size_t>(n()) * (n() - 1) / 2;
    const double all_over_now =
        static_cast<double>(all) / static_cast<double>(std::max<std::size_t>(1, n_pairs));
    const ReconstructionTimes& t = result_.times;
    const double pairs_s = t.matching_s + t.verifying_s;
    std::vector<StrongerSetting> settings;
    settings.push_back({"a relaxed start and half the evidence per picture", pairs_s + t.mapping_s, [&] {
                          Try(matches, true);
                        }});
    if (n_pairs < all) {
      settings.push_back({fmt::format("all {} pairs", all), pairs_s * all_over_now + t.mapping_s, [&] {
                            Try(Match(AllPairs(n())), true);
                          }});
    }
    if (options_.features < kRetryFeatures) {
      // Comparing descriptors costs the square of their number.
      const double growth = static_cast<double>(kRetryFeatures) / options_.features;
      settings.push_back({fmt::format("up to {} features per picture and all pairs", kRetryFeatures),
                          t.features_s + pairs_s * all_over_now * growth * growth + t.mapping_s * growth,
                          [&] {
                            Detect(kRetryFeatures);
                            Try(Match(AllPairs(n())), true);
                          }});
    }
    return settings;
  }

  MappingAttempt Map(std::shared_ptr<const CapturedViews> views,
                     std::vector<PairMatches> matches,
                     bool relaxed) {
    const fs::path folder = work_folder_ / fmt::format("attempt{}", ++n_attempts_);
    MappingAttempt attempt = Attempt(
        pictures_, std::move(views), std::move(matches), images_folder_, folder, relaxed, options_.threads);
    result_.times.verifying_s += attempt.verifying_s;
    result_.times.mapping_s += attempt.mapping_s;
    CountUse(attempt.cpu_s, attempt.peak_rss_bytes);
    return attempt;
  }

  void RefuseUnusable() const {
    if (const auto refusal = JudgeModel(result_.model, best_->evidence)) throw NotReconstructible(*refusal);
  }

  // Seen straight down, a flat ground looks the same from higher up through a longer lens.
  void DescribeFlatness() const {
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

  void Adjust() {
    const io::Stopwatch stopwatch;
    CameraModelOptions options{.camera_model = options_.camera_model};
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

  PairAgreement Agreement() const {
    return CompareWithPairs(
        best_->models.front().scene, best_->views->names, best_->views->features, best_->evidence.pairs);
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
  if (options.retry_minutes > 0) session.TryStrongerSettings(matches, pairs.size());
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
