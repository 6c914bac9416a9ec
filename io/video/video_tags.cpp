#include "io/video/video_tags.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "io/process/process.h"

namespace io {
namespace {

constexpr double kProbeTimeoutS = 20;  // reading a header takes less than a second
// Of cameras: 0.75 to 1.5; of what is beyond, the header is wrong.
constexpr double kMaxPixelAspect = 3;

// "4:3"; 1 where that says nothing.
double PixelAspect(const std::string& ratio) {
  int width = 0, height = 0;
  if (std::sscanf(ratio.c_str(), "%d:%d", &width, &height) != 2 || width <= 0 || height <= 0) return 1;
  const double aspect = static_cast<double>(width) / height;
  return aspect < kMaxPixelAspect && aspect > 1 / kMaxPixelAspect ? aspect : 1;
}

}  // namespace

VideoTags ReadVideoTags(const std::filesystem::path& path) {
  const auto ffprobe = FindProgram("ffprobe");
  if (!ffprobe) return {};
  // The demuxers and the protocol that the reader allows; "file:" keeps a colon in the name from being one.
  const std::string text =
      OutputOf({ffprobe->string(),
                "-v",
                "quiet",
                "-protocol_whitelist",
                "file",
                "-format_whitelist",
                "mov,matroska,avi",
                "-select_streams",
                "v:0",
                "-show_entries",
                "stream=color_space,color_transfer,color_primaries,field_order,sample_aspect_ratio",
                "-of",
                "json",
                "file:" + std::filesystem::absolute(path).string()},
               kProbeTimeoutS);
  const nlohmann::json answer = nlohmann::json::parse(text, nullptr, false);
  if (!answer.is_object() || !answer.contains("streams") || answer["streams"].empty()) return {};
  const nlohmann::json& stream = answer["streams"][0];
  const auto value = [&](const char* key) {
    return stream.contains(key) && stream[key].is_string() ? stream[key].get<std::string>() : "";
  };
  const std::string order = value("field_order");  // which field is coded and shown first: tt, bb, tb, bt
  return {.colours = {value("color_space"), value("color_transfer"), value("color_primaries")},
          .is_interlaced = order == "tt" || order == "bb" || order == "tb" || order == "bt",
          .pixel_aspect = PixelAspect(value("sample_aspect_ratio"))};
}

}  // namespace io
