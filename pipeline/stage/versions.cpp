#include "pipeline/stage/versions.h"

#include <nlohmann/json.hpp>

namespace pipeline {

nlohmann::ordered_json VersionsJson() {
  return {{"pipeline", PIPELINE_VERSION},
          {"commit", PIPELINE_COMMIT},
          {"compiler", "g++ " __VERSION__},
          {"opencv", OPENCV_VERSION}};
}

}  // namespace pipeline
