#include <fmt/format.h>

#include <algorithm>

#include "io/process/progress.h"
#include "io/process/stopwatch.h"
#include "sfm/adjust_joined.h"
#include "sfm/features/shared_features.h"
#include "sfm/features/stationary_matches.h"
#include "sfm/gaps.h"
#include "sfm/mapping/bridging.h"
#include "sfm/mapping/diagnosis.h"
#include "sfm/second_look.h"
#include "sfm/session.h"

namespace sfm {
namespace {

constexpr int kRetryFeatures = 8192;
// Further attempts are made while fewer pictures than this are registered.
constexpr double kGoodRegisteredShare = 0.9;
// At most what mapping as a whole takes, in times of mapping in blocks: 1.6 on 300 pictures and two cores,
// more on larger captures and more cores.
constexpr double kWholeOverBlocks = 4;
// Both sides of a gap are mapped and triangulated once more; matching three pairs per picture is nothing.
constexpr double kBridgingOverMapping = 2;
// Comparisons of descriptors for the second look, over all that were made before it: at most doubling a step
// that takes a quarter of the time.
constexpr double kSecondLookCost = 1;
// Half the usual one, and in full size: a picture is mostly left out because it is dark or plain.
constexpr double kSecondLookContrast = 0.01;

}  // namespace

std::vector<Session::StrongerSetting> Session::StrongerSettings(const std::vector<PairMatches>& matches,
                                                                std::size_t n_pairs) {
  const std::size_t all = pictures_.size() * (pictures_.size() - 1) / 2;
  const double all_over_now =
      static_cast<double>(all) / static_cast<double>(std::max<std::size_t>(1, n_pairs));
  const ReconstructionTimes& t = result_.times;
  const double pairs_s = t.matching_s + t.verifying_s;
  std::vector<StrongerSetting> settings;
  if (options_.mapping == "auto" && InBlocks()) {
    settings.push_back({"all pictures as a whole", kWholeOverBlocks * t.mapping_s, [&] {
                          as_a_whole_ = true;
                          Try(matches, false);
                        }});
  }
  if (options_.detector == "opencv" && best_->Registered() > 0 && !AroundGaps(*best_).empty()) {
    settings.push_back({"following pictures, contrast evened out, to bridge gaps between parts of a walk",
                        kBridgingOverMapping * t.mapping_s,
                        [&] { BridgeGaps(); }});
  }
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

void Session::TryStrongerSettings(const std::vector<PairMatches>& matches, std::size_t n_pairs) {
  for (const StrongerSetting& setting : StrongerSettings(matches, n_pairs)) {
    if (Registered(kGoodRegisteredShare)) return;
    const RefusalCause cause = ExplainFailure(best_->evidence, best_->Registered()).cause;
    // A stronger setting cannot cure a capture without baseline, texture or pictures.
    const bool curable = cause == RefusalCause::kNoOverlap || cause == RefusalCause::kMisfit;
    if (!Registered(kMinRegisteredShare) && !curable) return;
    const std::string so_far = fmt::format("only {} of {} pictures registered; ", best_->Registered(), n());
    if (retry_s_ + setting.estimate_s > 60 * options_.retry_minutes) {
      decide_(so_far + fmt::format("not tried: {}, about {} (--retry-minutes)",
                                   setting.text,
                                   io::FormatDuration(setting.estimate_s)));
      continue;
    }
    decide_(so_far + "trying again with " + setting.text);
    const io::Stopwatch stopwatch;
    setting.attempt();
    retry_s_ += stopwatch.seconds();
  }
}

std::vector<Features> Session::EvenContrastFeatures(const std::vector<int>& chosen) {
  const io::Stopwatch stopwatch;
  std::vector<Features> found = DetectOnAllRanks(images_folder_,
                                                 NamesOf(chosen),
                                                 options_.masks_folder,
                                                 {.max_features = best_max_features_,
                                                  .max_image_size = options_.max_image_size,
                                                  .even_contrast = true,
                                                  .threads = options_.threads,
                                                  .memory = options_.memory});
  std::vector<Features> features(pictures_.size());
  for (std::size_t i = 0; i < chosen.size(); ++i)
    features[static_cast<std::size_t>(chosen[i])] = std::move(found[i]);
  result_.times.features_s += stopwatch.seconds();
  return features;
}

void Session::BridgeGaps() {
  const std::vector<int> chosen = AroundGaps(*best_);
  const std::vector<Features> even = EvenContrastFeatures(chosen);
  auto views = std::make_shared<CapturedViews>(*best_->views);
  const io::Stopwatch stopwatch;
  const ImagePairs pairs = FollowingPairs(chosen);
  // Apart from each other: what is found both ways would not be distinct.
  std::vector<PairMatches> matches = MatchOnAllRanks(views->features, pairs, options_.threads);
  AddFeatures(even, MatchOnAllRanks(even, pairs, options_.threads), &views->features, &matches);
  result_.times.matching_s += stopwatch.seconds();
  if (stands_still_) DropStationaryMatches(views->features, &matches);
  MappingAttempt attempt = Bridge(*best_,
                                  pictures_,
                                  std::move(views),
                                  matches,
                                  images_folder_,
                                  AttemptFolder(),
                                  {.adjust_joined = AdjustBridged, .threads = options_.threads});
  CountAttempt(attempt);
  if (attempt.Registered() <= best_->Registered()) return;
  const PairAgreement agreement = CompareWithPairs(
      attempt.models.front().scene, attempt.views->names, attempt.views->features, attempt.evidence.pairs);
  if (agreement.Contradicts()) {
    decide_("not taken: " + agreement.Figures());
    return;
  }
  decide_(fmt::format("{} more pictures, joined to the others across a gap",
                      attempt.Registered() - best_->Registered()));
  for (const std::string& name : NamesOf(LeftOutPictures(*best_))) bridged_.insert(name);
  best_ = std::move(attempt);
}

std::shared_ptr<const CapturedViews> Session::WithMoreFeatures(const CapturedViews& views,
                                                               const std::vector<int>& chosen,
                                                               const std::vector<std::string>& names,
                                                               int max_features) {
  auto more = std::make_shared<CapturedViews>(views);
  if (options_.detector != "opencv") return more;
  const io::Stopwatch stopwatch;
  std::vector<Features> features = DetectOnAllRanks(images_folder_,
                                                    names,
                                                    options_.masks_folder,
                                                    {.max_features = max_features,
                                                     .max_image_size = 0,
                                                     .min_contrast = kSecondLookContrast,
                                                     .threads = options_.threads,
                                                     .memory = options_.memory});
  for (std::size_t i = 0; i < chosen.size(); ++i)
    more->features[static_cast<std::size_t>(chosen[i])] = std::move(features[i]);
  result_.times.features_s += stopwatch.seconds();
  return more;
}

void Session::LookAgain() {
  if (Registered(1) || !Registered(kMinRegisteredShare)) return;
  const int features =
      options_.detector == "opencv" ? std::max(best_max_features_, kRetryFeatures) : best_max_features_;
  const std::size_t all = pictures_.size() * (pictures_.size() - 1) / 2;
  if (best_->matches.size() == all && features == best_max_features_) return;  // nothing new to see
  const std::vector<int> left_out = LeftOutPictures(*best_);
  const std::vector<int> chosen =
      WithinCeiling(left_out, best_->views->features, features, kSecondLookCost * comparisons_);
  const std::string so_far = fmt::format("{} of {} pictures registered; ", best_->Registered(), n());
  if (chosen.empty()) {
    decide_(so_far +
            "not tried: a second look at the others, which would cost more than all matching so far");
    return;
  }
  const ReconstructionTimes& t = result_.times;
  const double estimate_s = kSecondLookCost * (t.matching_s + t.verifying_s) + t.mapping_s;
  if (retry_s_ + estimate_s > 60 * options_.retry_minutes) {
    decide_(so_far + fmt::format("not tried: a second look at the others, at most {} (--retry-minutes)",
                                 io::FormatDuration(estimate_s)));
    return;
  }
  decide_(so_far + fmt::format("a second look at {} of the {} others: with all pictures, up to {} features",
                               chosen.size(),
                               left_out.size(),
                               features));
  AddToModel(chosen, features);
}

void Session::AddToModel(const std::vector<int>& chosen, int max_features) {
  const std::vector<std::string> names = NamesOf(chosen);
  views_ = WithMoreFeatures(*best_->views, chosen, names, max_features);
  std::vector<PairMatches> matches = Match(PairsWith(chosen, n()));
  if (stands_still_) DropStationaryMatches(views_->features, &matches);
  const std::vector<int> left_out = LeftOutPictures(*best_);
  best_ =
      Continue(*best_, pictures_, views_, matches, names, images_folder_, AttemptFolder(), options_.threads);
  CountAttempt(*best_);
  // All that were left out, chosen or not: continuing with some may bring in others.
  for (const std::string& name : DropContradicted(NamesOf(left_out), &*best_))
    TakeOut(name, "most of its matches contradict the pose found by the second look");
  const auto registered =
      static_cast<int>(left_out.size()) - static_cast<int>(LeftOutPictures(*best_).size());
  decide_(fmt::format("the second look registered {} more", registered));
}

}  // namespace sfm
