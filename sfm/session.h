// The work on one capture: what is known so far, and the mapping attempts made with it. Used by Reconstruct
// only.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "sfm/mapping/mapping_attempt.h"
#include "sfm/mapping/pair_agreement.h"
#include "sfm/reconstruction.h"

namespace sfm {

// A model of fewer pictures is a fragment: its film would hide that the capture failed.
constexpr double kMinRegisteredShare = 0.6;

class Session {
 public:
  using Decide = std::function<void(const std::string&)>;

  // The references must outlive the session.
  Session(const std::vector<Picture>& pictures,
          const std::filesystem::path& images_folder,
          const std::filesystem::path& work_folder,
          const ReconstructionOptions& options,
          const Decide& decide);

  void SetFeatures(std::vector<Features> features);
  void Detect(int max_features);
  ImagePairs ChoosePairs();
  std::vector<PairMatches> Match(const ImagePairs& pairs);

  // Keeps the attempt when it registers more pictures than the best so far.
  void Try(std::vector<PairMatches> matches, bool relaxed);

  // Maps again with stronger settings while too few pictures are registered, within a ceiling of time.
  // `matches` are those of the `n_pairs` pairs tried so far.
  void TryStrongerSettings(const std::vector<PairMatches>& matches, std::size_t n_pairs);

  // Whatever is still left out is matched with all other pictures, by more features, and added to the model
  // as it is. That costs at most as many comparisons of descriptors as were made so far.
  void LookAgain();

  // Where pairs contradict the model, places that look alike may have been taken for one. Neighbours in the
  // order of the pictures are the pairs least likely to be mistaken.
  void ResolveContradictions();

  // Adjusts the best model, or refuses the capture.
  Reconstruction Finish();

 private:
  struct StrongerSetting {
    std::string text;
    double estimate_s;
    std::function<void()> attempt;
  };

  int n() const { return static_cast<int>(pictures_.size()); }
  std::vector<std::string> NamesOf(const std::vector<int>& pictures) const;
  // Whether pictures are mapped in overlapping blocks.
  bool InBlocks() const;
  bool Registered(double share) const;
  // Cheapest first.
  std::vector<StrongerSetting> StrongerSettings(const std::vector<PairMatches>& matches, std::size_t n_pairs);
  // The same views but for more features in some of the pictures. COLMAP's detector keeps those it has.
  std::shared_ptr<const CapturedViews> WithMoreFeatures(const CapturedViews& views,
                                                        const std::vector<int>& chosen,
                                                        const std::vector<std::string>& names,
                                                        int max_features);
  // Matches pictures around those that the best model lacks with the pictures that follow them, by features
  // of an even contrast besides, and joins what hangs on the model by these alone.
  void BridgeGaps();
  // Further features of these pictures, none of the others.
  std::vector<Features> EvenContrastFeatures(const std::vector<int>& chosen);
  // Matches the chosen pictures with all others and continues the best model with them.
  void AddToModel(const std::vector<int>& chosen, int max_features);
  MappingAttempt Map(std::shared_ptr<const CapturedViews> views,
                     std::vector<PairMatches> matches,
                     bool relaxed);
  std::filesystem::path AttemptFolder();
  void CountAttempt(const MappingAttempt& attempt);
  void CountUse(double cpu_s, std::size_t peak_rss_bytes);
  PairAgreement Agreement() const;
  void Adjust();
  void DropUncertainPictures();
  // Names pictures of the adjusted model, with the reason; model and largest attempt keep them.
  std::set<std::string> TakeOutUncertain();
  std::set<std::string> TakeOutMisfitting();
  void TakeOut(const std::string& name, const std::string& reason);
  void RefuseUnusable() const;
  // Seen straight down, a flat ground looks the same from higher up through a longer lens.
  void DescribeFlatness() const;

  const std::vector<Picture>& pictures_;
  std::filesystem::path images_folder_, work_folder_;
  const ReconstructionOptions& options_;
  const Decide& decide_;
  std::shared_ptr<const CapturedViews> views_;  // with the latest features
  std::optional<MappingAttempt> best_;
  std::set<std::string> bridged_;                 // pictures that are joined to the others across a gap
  std::map<std::string, std::string> taken_out_;  // why, by picture
  int n_attempts_ = 0;
  int max_features_ = 0, best_max_features_ = 0;  // per picture, of the latest ones and of the best attempt
  double retry_s_ = 0;                            // spent on further attempts
  double comparisons_ = 0;                        // of descriptors, so far
  bool stands_still_ = false;                     // stationary matches were removed
  bool as_a_whole_ = false;                       // blocks have failed
  Reconstruction result_;
};

}  // namespace sfm
