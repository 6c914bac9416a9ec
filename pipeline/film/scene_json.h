// What pages to look around in know of a scene.
#pragma once

#include <string>
#include "io/base/json.h"

#include "io/scene/scene.h"

namespace pipeline {

// The cameras of the scene, the point that they look at, and what is up.
io::Json SceneJson(const io::Scene& scene, const std::string& run_name);

}  // namespace pipeline
