#include "sfm/features/shared_features.h"

#include "io/base/packed.h"
#include "io/process/ranks.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;
using io::TaskResults;
using Tasks = std::vector<std::size_t>;
using PairList = std::vector<std::array<int, 2>>;

constexpr const char *kDetect = "detect", *kMatch = "match", *kVerify = "verify";

TaskResults DetectSome(const fs::path& images_folder,
                       const std::vector<std::string>& names,
                       const fs::path& masks_folder,
                       const FeatureOptions& options,
                       const Tasks& tasks) {
  std::vector<std::string> own;
  for (const std::size_t i : tasks) own.push_back(names[i]);
  TaskResults results;
  for (const Features& of : DetectFeatures(images_folder, own, masks_folder, options))
    results.push_back(io::Packer().Add(of.keypoints).Add(of.descriptors).Take());
  return results;
}

TaskResults MatchSome(const std::vector<Features>& features,
                      const PairList& pairs,
                      int threads,
                      const Tasks& tasks) {
  ImagePairs own;
  for (const std::size_t i : tasks) own.emplace(pairs[i][0], pairs[i][1]);
  TaskResults results;
  for (const PairMatches& pair : MatchFeatures(features, own, threads))
    results.push_back(io::Packer().Add(pair.matches).Take());
  return results;
}

TaskResults VerifySome(const std::vector<Features>& features,
                       const std::vector<PairMatches>& pairs,
                       int threads,
                       const Tasks& tasks) {
  std::vector<PairMatches> own;
  for (const std::size_t i : tasks) own.push_back(pairs[i]);
  TaskResults results;
  for (const TwoViewGeometry& geometry : EstimateTwoViewGeometries(features, own, threads))
    results.push_back(io::Packer().Add(geometry.kind).Add(geometry.matches).Take());
  return results;
}

}  // namespace

std::vector<Features> DetectOnAllRanks(const fs::path& images_folder,
                                       const std::vector<std::string>& names,
                                       const fs::path& masks_folder,
                                       const FeatureOptions& options) {
  if (!io::AllRanks().AreSeveral()) return DetectFeatures(images_folder, names, masks_folder, options);
  const auto tell = [&] {
    return io::Packer()
        .Add(names)
        .Add(options.max_features)
        .Add(options.max_image_size)
        .Add(options.min_contrast)
        .Add(options.even_contrast)
        .Take();
  };
  std::vector<Features> features;
  for (const std::string& bytes : io::ShareOut(kDetect, names.size(), tell, [&](const Tasks& tasks) {
         return DetectSome(images_folder, names, masks_folder, options, tasks);
       })) {
    io::Unpacker result(bytes);
    Features& of = features.emplace_back();
    result.Take(&of.keypoints);
    result.Take(&of.descriptors);
  }
  return features;
}

std::vector<PairMatches> MatchOnAllRanks(const std::vector<Features>& features,
                                         const ImagePairs& pairs,
                                         int threads) {
  if (!io::AllRanks().AreSeveral()) return MatchFeatures(features, pairs, threads);
  PairList listed;
  for (const auto& [a, b] : pairs) listed.push_back({a, b});
  const auto tell = [&] {
    io::Packer told;
    told.Add(listed).Add(features.size());
    for (const Features& of : features) told.Add(of.descriptors);
    return told.Take();
  };
  const TaskResults results = io::ShareOut(kMatch, listed.size(), tell, [&](const Tasks& tasks) {
    return MatchSome(features, listed, threads, tasks);
  });
  std::vector<PairMatches> matches;
  for (std::size_t i = 0; i < listed.size(); ++i) {
    matches.push_back({listed[i][0], listed[i][1], {}});
    io::Unpacker(results[i]).Take(&matches.back().matches);
  }
  return matches;
}

std::vector<TwoViewGeometry> VerifyOnAllRanks(const std::vector<Features>& features,
                                              const std::vector<PairMatches>& pairs,
                                              int threads) {
  if (!io::AllRanks().AreSeveral()) return EstimateTwoViewGeometries(features, pairs, threads);
  const auto tell = [&] {
    io::Packer told;
    told.Add(features.size());
    for (const Features& of : features) told.Add(of.keypoints);
    told.Add(pairs.size());
    for (const PairMatches& pair : pairs) told.Add(pair.a).Add(pair.b).Add(pair.matches);
    return told.Take();
  };
  std::vector<TwoViewGeometry> geometries;
  for (const std::string& bytes : io::ShareOut(kVerify, pairs.size(), tell, [&](const Tasks& tasks) {
         return VerifySome(features, pairs, threads, tasks);
       })) {
    io::Unpacker result(bytes);
    TwoViewGeometry& geometry = geometries.emplace_back();
    result.Take(&geometry.kind);
    result.Take(&geometry.matches);
  }
  return geometries;
}

void AddFeatureWorks(const fs::path& images_folder,
                     const fs::path& masks_folder,
                     int threads,
                     const io::MemoryBudget& memory,
                     io::ToldWorks* works) {
  (*works)[kDetect] = [=](const std::string& bytes, const Tasks& tasks) {
    io::Unpacker told(bytes);
    FeatureOptions options{.threads = threads, .memory = memory};
    const auto names = told.Take<std::vector<std::string>>();
    told.Take(&options.max_features);
    told.Take(&options.max_image_size);
    told.Take(&options.min_contrast);
    told.Take(&options.even_contrast);
    return DetectSome(images_folder, names, masks_folder, options, tasks);
  };
  (*works)[kMatch] = [=](const std::string& bytes, const Tasks& tasks) {
    io::Unpacker told(bytes);
    const auto pairs = told.Take<PairList>();
    std::vector<Features> features(told.Take<std::size_t>());
    for (Features& of : features) {
      told.Take(&of.descriptors);
      of.keypoints.resize(of.descriptors.size() / kDescriptorBytes);  // matching asks for their number alone
    }
    return MatchSome(features, pairs, threads, tasks);
  };
  (*works)[kVerify] = [=](const std::string& bytes, const Tasks& tasks) {
    io::Unpacker told(bytes);
    std::vector<Features> features(told.Take<std::size_t>());
    for (Features& of : features) told.Take(&of.keypoints);
    std::vector<PairMatches> pairs(told.Take<std::size_t>());
    for (PairMatches& pair : pairs) {
      told.Take(&pair.a);
      told.Take(&pair.b);
      told.Take(&pair.matches);
    }
    return VerifySome(features, pairs, threads, tasks);
  };
}

}  // namespace sfm
