// Which code made a result.
#pragma once

#include <string>

namespace pipeline {

// Code version, compiler and library versions as JSON text.
std::string VersionsJson();

}  // namespace pipeline
