// Which code made a result.
#pragma once

#include "io/base/json.h"

namespace pipeline {

// {"pipeline": ..., "commit": ..., "compiler": ..., "opencv": ...}
io::Json VersionsJson();

}  // namespace pipeline
