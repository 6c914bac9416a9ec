// Why a capture was refused, or one picture of it left out: a cause, the figures that show it, and a remedy.
#pragma once

#include <string>

#include "io/base/error.h"

namespace sfm {

// Fewer pictures give no third view to confirm a point.
constexpr int kMinPictures = 3;

enum class RefusalCause {
  kTooFewPictures,
  kNoTexture,
  kBlur,
  kNoOverlap,         // the largest group of pictures linked by matches is small
  kRotationOnly,      // homographies explain nearly all pairs
  kNarrowRays,        // rays to the same point hardly diverge
  kPointsOnOneLine,   // the cameras could turn about it
  kMisfit,            // linked by matches, but no model agrees with them
  kLargeError,        // the points miss their pictures
  kContradictedPoses  // matches of many pairs contradict the model
};

// What users read: "no baseline". Several causes may have the same name.
const std::string& Name(RefusalCause cause);

struct Refusal {
  RefusalCause cause;
  std::string figures;  // what was measured

  std::string Summary() const;  // "name: figures", without a remedy
  std::string Message() const;  // "name: figures; remedy"
};

// The exit code is kNotReconstructible, the text the refusal's message.
class NotReconstructible : public io::Error {
 public:
  explicit NotReconstructible(const Refusal& refusal)
      : Error(io::ExitCode::kNotReconstructible, refusal.Message()), refusal_(refusal) {}
  const Refusal& refusal() const { return refusal_; }

 private:
  Refusal refusal_;
};

}  // namespace sfm
