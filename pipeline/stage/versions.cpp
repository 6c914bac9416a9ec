#include "pipeline/stage/versions.h"

#include <nlohmann/json.hpp>

#include "io/base/json.h"

namespace pipeline {

io::Json VersionsJson() {
  return {{"pipeline", PIPELINE_VERSION},
          {"commit", PIPELINE_COMMIT},
          {"compiler", "g++ " __VERSION__},
          {"opencv", OPENCV_VERSION}};
}

}  // namespace pipeline
