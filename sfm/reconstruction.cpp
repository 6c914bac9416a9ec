#include "sfm/reconstruction.h"

#include <fmt/format.h>

#include <algorithm>

#include "sfm/colmap/colmap.h"
#include "sfm/features/shared_features.h"
#include "sfm/session.h"

namespace sfm {

namespace fs = std::filesystem;
using Decide = std::function<void(const std::string&)>;

namespace {

constexpr double kMostFeatures = 4096, kFewestFeatures = 2048, kAllFeatures = 400 * kMostFeatures;

}  // namespace

int FeaturesFor(std::size_t n_pictures) {
  return static_cast<int>(
      std::clamp(kAllFeatures / static_cast<double>(n_pictures), kFewestFeatures, kMostFeatures));
}

Reconstruction Reconstruct(const std::vector<Picture>& pictures,
                           const fs::path& images_folder,
                           const fs::path& work_folder,
                           const ReconstructionOptions& given,
                           const Decide& decide) {
  ReconstructionOptions options = given;
  if (options.features == 0) {
    options.features = FeaturesFor(pictures.size());
    if (options.features < kMostFeatures)
      decide(fmt::format("features: {} per picture, for {} pictures", options.features, pictures.size()));
  }
  Session session(pictures, images_folder, work_folder, options, decide);
  session.Detect(options.features);
  const ImagePairs pairs = session.ChoosePairs();
  std::vector<PairMatches> matches = session.Match(pairs);
  session.Try(matches, false);
  if (options.retry_minutes > 0) {
    session.TryStrongerSettings(matches, pairs.size());
    session.LookAgain();
  }
  session.ResolveContradictions();
  return session.Finish();
}

void AddReconstructionWorks(const fs::path& images_folder,
                            const fs::path& work_folder,
                            const ReconstructionOptions& options,
                            io::ToldWorks* works) {
  AddFeatureWorks(images_folder, options.masks_folder, options.threads, options.memory, works);
  Colmap::AddWorks(work_folder, images_folder, options.threads, works);
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
