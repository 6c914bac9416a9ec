// Detection, matching and verification by all ranks (io/process/shared_work.h).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/process/shared_work.h"
#include "sfm/features/features.h"
#include "sfm/features/matching.h"
#include "sfm/features/two_view.h"

namespace sfm {

// As DetectFeatures, MatchFeatures and EstimateTwoViewGeometries, called by rank 0.
std::vector<Features> DetectOnAllRanks(const std::filesystem::path& images_folder,
                                       const std::vector<std::string>& names,
                                       const std::filesystem::path& masks_folder,
                                       const FeatureOptions& options);
std::vector<PairMatches> MatchOnAllRanks(const std::vector<Features>& features,
                                         const ImagePairs& pairs,
                                         int threads);
std::vector<TwoViewGeometry> VerifyOnAllRanks(const std::vector<Features>& features,
                                              const std::vector<PairMatches>& pairs,
                                              int threads);

// What the other ranks do for these, with their own folders, threads and memory.
void AddFeatureWorks(const std::filesystem::path& images_folder,
                     const std::filesystem::path& masks_folder,
                     int threads,
                     const io::MemoryBudget& memory,
                     io::ToldWorks* works);

}  // namespace sfm
