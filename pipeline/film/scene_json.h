// What pages to look around in know of a scene.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "io/scene/scene.h"

namespace pipeline {

// The cameras of the scene, the point that they look at, and what is up.
nlohmann::ordered_json SceneJson(const io::Scene& scene, const std::string& run_name);

}  // namespace pipeline
