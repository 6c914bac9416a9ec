#include "pipeline/stage/versions.h"

#include <nlohmann/json.hpp>

namespace pipeline {

std::string VersionsJson() {
  return nlohmann::ordered_json{{"pipeline", PIPELINE_VERSION},
                                {"commit", PIPELINE_COMMIT},
                                {"compiler", "g++ " __VERSION__},
                                {"opencv", OPENCV_VERSION}}
      .dump();
}

}  // namespace pipeline
