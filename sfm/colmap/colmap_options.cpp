#include "sfm/colmap/colmap_options.h"

#include <initializer_list>

#include "io/base/error.h"

namespace sfm {
namespace {

// True when the help lists exactly this option: "--Mapper.num" must not be found in "--Mapper.num_threads".
bool Lists(const std::string& help, const std::string& flag) {
  for (std::size_t at = help.find(flag); at != std::string::npos; at = help.find(flag, at + 1)) {
    const std::size_t end = at + flag.size();
    const bool starts = at == 0 || help[at - 1] == ' ' || help[at - 1] == '\n';
    if (starts && (end == help.size() || std::string(" \t\r\n").find(help[end]) != std::string::npos))
      return true;
  }
  return false;
}

std::string FirstListed(const std::string& command,
                        const std::string& help,
                        std::initializer_list<const char*> flags) {
  std::string tried;
  for (const char* flag : flags) {
    if (Lists(help, flag)) return flag;
    tried += tried.empty() ? flag : std::string(" or ") + flag;
  }
  throw io::Error(io::ExitCode::kMissingTool,
                  "colmap " + command + " has no option " + tried,
                  "Install a COLMAP from 3.8 to 4.x (apt-get install colmap)");
}

struct Flag {
  std::initializer_list<const char*> names;
  const char* value;
};

// Those that the help lists, by the first of their names that it knows.
std::vector<std::string> Listed(const std::string& help, std::initializer_list<Flag> flags) {
  std::vector<std::string> arguments;
  for (const Flag& flag : flags) {
    for (const char* name : flag.names) {
      if (!Lists(help, name)) continue;
      arguments.insert(arguments.end(), {name, flag.value});
      break;
    }
  }
  return arguments;
}

// A final adjustment of our own follows, so the mapper only needs to keep its model from drifting: on 50
// photos fewer adjustments halve its time, and ending them where a step gains less than 0.1 % (COLMAP goes on
// to the last iteration) halves it again on 75, with the same points and the same error to 0.4 %. Tele lenses
// of 2 degrees have 30 times the picture's side as focal length; COLMAP drops pictures beyond 10.
std::vector<std::string> MapperOptions(const std::string& help) {
  return Listed(help,
                {
                    {{"--Mapper.ba_global_frames_ratio", "--Mapper.ba_global_images_ratio"}, "1.5"},
                    {{"--Mapper.ba_global_points_ratio"}, "1.5"},
                    {{"--Mapper.ba_global_max_num_iterations"}, "10"},
                    {{"--Mapper.ba_global_max_refinements"}, "1"},
                    {{"--Mapper.ba_global_function_tolerance"}, "1e-3"},
                    {{"--Mapper.ba_local_max_num_iterations"}, "10"},
                    {{"--Mapper.ba_local_max_refinements"}, "1"},
                    {{"--Mapper.ba_local_function_tolerance"}, "1e-3"},
                    {{"--Mapper.max_focal_length_ratio"}, "30"},
                });
}

}  // namespace

ColmapFlags ParseColmapHelp(const std::string& extractor_help, const std::string& mapper_help) {
  const auto extractor = [&](std::initializer_list<const char*> flags) {
    return FirstListed("feature_extractor", extractor_help, flags);
  };
  return {
      .extraction_use_gpu = extractor({"--FeatureExtraction.use_gpu", "--SiftExtraction.use_gpu"}),
      .extraction_threads = extractor({"--FeatureExtraction.num_threads", "--SiftExtraction.num_threads"}),
      .extraction_image_size =
          extractor({"--FeatureExtraction.max_image_size", "--SiftExtraction.max_image_size"}),
      .extraction_features =
          extractor({"--SiftExtraction.max_num_features", "--FeatureExtraction.max_num_features"}),
      .mapper_threads = FirstListed("mapper", mapper_help, {"--Mapper.num_threads"}),
      .mapper_options = MapperOptions(mapper_help),
      .two_view_tracks = Listed(mapper_help, {{{"--Mapper.tri_ignore_two_view_tracks"}, "0"}}),
  };
}

std::string MatchingGpuFlag(const std::string& matcher_help) {
  return FirstListed(
      "exhaustive_matcher", matcher_help, {"--FeatureMatching.use_gpu", "--SiftMatching.use_gpu"});
}

}  // namespace sfm
