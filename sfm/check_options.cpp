#include "sfm/check_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <set>
#include <string>

#include "io/base/error.h"

namespace sfm {
namespace {

using io::Error;
using io::ExitCode;

void CheckChoice(const std::string& flag, const std::string& value, const std::set<std::string>& choices) {
  if (choices.count(value) > 0) return;
  throw Error(ExitCode::kUsage,
              fmt::format("{}: '{}' is unknown", flag, value),
              fmt::format("Use one of: {}", fmt::join(choices, ", ")));
}

}  // namespace

void CheckOptions(const ReconstructionOptions& options) {
  CheckChoice("--camera-model",
              options.camera_model,
              {"auto", "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"});
  CheckChoice("--matching", options.matching, {"auto", "exhaustive", "likely", "sequential"});
  CheckChoice("--mapping", options.mapping, {"auto", "whole", "blocks"});
  CheckChoice("--detector", options.detector, {"opencv", "colmap"});
  if (options.features != 0 && (options.features < 100 || options.features > 16384)) {
    throw Error(ExitCode::kUsage, fmt::format("--features: {} is not in 100..16384", options.features));
  }
}

}  // namespace sfm
