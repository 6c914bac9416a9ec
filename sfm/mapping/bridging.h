// Joins what a walk shows before and behind a place where pictures hardly hang together.
#pragma once

#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "sfm/mapping/mapping_attempt.h"

namespace sfm {

// Goes on from the largest model of `before` across a gap in the order of the pictures. `views` may have
// further keypoints behind those of `before`, and `matches` are pairs of pictures that follow each other,
// matched anew. All other pairs are taken over as verified, but for those between a picture of the model and
// one that it lacks: what they link may be two places that look alike, and pictures that follow each other
// are the least likely to be mistaken. The model then goes on to the first pictures behind the gap, all
// pictures that it lacked are mapped by themselves, and a model of these that shares a picture with it is
// joined to it (AlignModels, AlignAtPicture), adjusted together by options.adjust_joined, and triangulated
// anew. Pairs that were not used stay in the evidence. The models are those of `before` when nothing could be
// joined, or when in the end they are not held together.
MappingAttempt Bridge(const MappingAttempt& before,
                      const std::vector<Picture>& pictures,
                      std::shared_ptr<const CapturedViews> views,
                      const std::vector<PairMatches>& matches,
                      const std::filesystem::path& images_folder,
                      const std::filesystem::path& folder,
                      const MappingOptions& options);

// Whether two sides see enough points in common, and each picture that is not named as one of the near side
// sees enough at all: as many as COLMAP asks of two pictures, and of one that it adds on half the evidence.
// Wrong places keep hardly any, because three pictures must confirm each of them (office68: 39 across, 37 or
// more of each picture).
bool IsHeldTogether(const io::Scene& scene, const std::set<std::string>& near);
inline constexpr int kMinHoldingPoints = 15;

}  // namespace sfm
