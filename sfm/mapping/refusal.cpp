#include "sfm/mapping/refusal.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace sfm {
namespace {

struct Text {
  RefusalCause cause;
  std::string name, remedy;
};

const Text& TextOf(RefusalCause cause) {
  static const std::vector<Text> texts = {
      {RefusalCause::kTooFewPictures,
       "too few pictures",
       fmt::format("at least {} are needed, 30 or more are better", kMinPictures)},
      {RefusalCause::kNoTexture, "no texture", "put textured objects or a newspaper into the scene"},
      {RefusalCause::kBlur, "blur", "use more light, a faster shutter or a steadier hand"},
      {RefusalCause::kNoOverlap,
       "no overlap",
       "take pictures that share at least two thirds of their view with the next one"},
      {RefusalCause::kRotationOnly, "no baseline", "walk around the subject instead of turning on the spot"},
      {RefusalCause::kNarrowRays, "no baseline", "move the camera further between pictures"},
      {RefusalCause::kPointsOnOneLine, "no consistent model", "show more of the scene"},
      {RefusalCause::kMisfit,
       "no consistent model",
       "mask what moves, and walk sideways or around the subject rather than straight ahead"},
      {RefusalCause::kLargeError, "no consistent model", ""},
      {RefusalCause::kContradictedPoses,
       "no consistent model",
       "the scene repeats itself or moves: mask what moves, or take pictures in closer order"},
  };
  return *std::find_if(texts.begin(), texts.end(), [&](const Text& text) { return text.cause == cause; });
}

}  // namespace

const std::string& Name(RefusalCause cause) { return TextOf(cause).name; }

std::string Refusal::Summary() const { return Name(cause) + ": " + figures; }

std::string Refusal::Message() const {
  const std::string& remedy = TextOf(cause).remedy;
  return remedy.empty() ? Summary() : Summary() + "; " + remedy;
}

}  // namespace sfm
