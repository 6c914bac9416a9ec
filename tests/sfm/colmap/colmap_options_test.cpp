// Option names of COLMAP 3.8, 3.13 and 4.0, from shortened help texts.
#include "sfm/colmap/colmap_options.h"

#include <gtest/gtest.h>

#include "io/base/error.h"

namespace {

constexpr const char* kExtractor38 = R"(
  --ImageReader.single_camera arg (=0)
  --SiftExtraction.num_threads arg (=-1)
  --SiftExtraction.use_gpu arg (=1)
  --SiftExtraction.max_image_size arg (=3200)
  --SiftExtraction.max_num_features arg (=8192)
)";
constexpr const char* kMatcher38 = R"(
  --match_list_path arg
  --SiftMatching.num_threads arg (=-1)
  --SiftMatching.use_gpu arg (=1)
  --SiftMatching.max_num_matches arg (=32768)
)";
constexpr const char* kMapper =
    "  --Mapper.num_threads arg (=-1)\n  --Mapper.ba_global_images_ratio arg (=1.1)\n";

constexpr const char* kExtractor313 = R"(
  --FeatureExtraction.num_threads arg (=-1)
  --FeatureExtraction.use_gpu arg (=1)
  --FeatureExtraction.gpu_index arg (=-1)
  --SiftExtraction.max_image_size arg (=3200)
  --SiftExtraction.max_num_features arg (=8192)
)";
constexpr const char* kExtractor40 = R"(
  --FeatureExtraction.type arg (=SIFT)
  --FeatureExtraction.max_image_size arg (=-1)
  --FeatureExtraction.num_threads arg (=-1)
  --FeatureExtraction.use_gpu arg (=1)
  --SiftExtraction.max_num_features arg (=8192)
  --AlikedExtraction.max_num_features arg (=2048)
)";
constexpr const char* kMatcher313 = R"(
  --FeatureMatching.num_threads arg (=-1)
  --FeatureMatching.use_gpu arg (=1)
  --SiftMatching.max_ratio arg (=0.8)
)";

TEST(ColmapOptions, Names38) {
  const sfm::ColmapFlags flags = sfm::ParseColmapHelp(kExtractor38, kMapper);
  EXPECT_EQ(flags.extraction_use_gpu, "--SiftExtraction.use_gpu");
  EXPECT_EQ(flags.extraction_threads, "--SiftExtraction.num_threads");
  EXPECT_EQ(flags.extraction_image_size, "--SiftExtraction.max_image_size");
  EXPECT_EQ(flags.extraction_features, "--SiftExtraction.max_num_features");
  EXPECT_EQ(sfm::MatchingGpuFlag(kMatcher38), "--SiftMatching.use_gpu");
  EXPECT_EQ(flags.mapper_threads, "--Mapper.num_threads");
  EXPECT_TRUE(flags.two_view_tracks.empty()) << "an option that is not listed";
  EXPECT_EQ(sfm::ParseColmapHelp(kExtractor38,
                                 std::string(kMapper) + "  --Mapper.tri_ignore_two_view_tracks arg (=1)\n")
                .two_view_tracks,
            (std::vector<std::string>{"--Mapper.tri_ignore_two_view_tracks", "0"}));
}

TEST(ColmapOptions, Names313) {
  const sfm::ColmapFlags flags = sfm::ParseColmapHelp(kExtractor313, kMapper);
  EXPECT_EQ(flags.extraction_use_gpu, "--FeatureExtraction.use_gpu");
  EXPECT_EQ(flags.extraction_image_size, "--SiftExtraction.max_image_size");
  EXPECT_EQ(flags.extraction_features, "--SiftExtraction.max_num_features");
  EXPECT_EQ(sfm::MatchingGpuFlag(kMatcher313), "--FeatureMatching.use_gpu");
}

TEST(ColmapOptions, Names40) {
  const sfm::ColmapFlags flags = sfm::ParseColmapHelp(kExtractor40, kMapper);
  EXPECT_EQ(flags.extraction_image_size, "--FeatureExtraction.max_image_size");
  EXPECT_EQ(flags.extraction_features, "--SiftExtraction.max_num_features");
}

TEST(ColmapOptions, AMissingOptionIsNamedAndALongerOneIsNotTakenForIt) {
  try {
    sfm::MatchingGpuFlag("  --SiftMatching.use_gpu_index arg\n  --SiftMatching.num_threads arg");
    FAIL();
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kMissingTool);
    for (const char* name : {"exhaustive_matcher", "--FeatureMatching.use_gpu", "--SiftMatching.use_gpu"}) {
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
    }
  }
}

TEST(ColmapOptions, MapperOptionsAreThoseTheMapperLists) {
  EXPECT_EQ(sfm::ParseColmapHelp(kExtractor38, kMapper).mapper_options,
            (std::vector<std::string>{"--Mapper.ba_global_images_ratio", "1.5"}));
  EXPECT_EQ(sfm::ParseColmapHelp(kExtractor38,
                                 "  --Mapper.num_threads arg\n  --Mapper.ba_global_frames_ratio arg (=1.1)\n")
                .mapper_options,
            (std::vector<std::string>{"--Mapper.ba_global_frames_ratio", "1.5"}));
}

}  // namespace
