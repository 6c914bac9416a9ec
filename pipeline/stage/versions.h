// Which code made a result.
#pragma once

#include <nlohmann/json_fwd.hpp>

namespace pipeline {

// {"pipeline": ..., "commit": ..., "compiler": ..., "opencv": ...}
nlohmann::ordered_json VersionsJson();

}  // namespace pipeline
