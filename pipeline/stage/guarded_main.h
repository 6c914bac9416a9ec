// The error policy of every program.
#pragma once

#include <functional>
#include <string>

namespace pipeline {

// Runs a body with the project's error policy: one line on stderr and the documented exit code.
int GuardedMain(const std::string& program, const std::function<void()>& body);

}  // namespace pipeline
