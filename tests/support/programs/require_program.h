// Support for tests: programs that the packages of samples/packages.txt install.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "io/process/process.h"

// Skips the test when the program is missing; tests/run.sh, which installs it, makes that a failure.
#define REQUIRE_PROGRAM(name)                                                            \
  do {                                                                                   \
    if (!io::FindProgram(name)) {                                                        \
      ASSERT_EQ(std::getenv("PIPELINE_ALL_PROGRAMS"), nullptr) << name << " is missing"; \
      GTEST_SKIP() << name << " is not installed";                                       \
    }                                                                                    \
  } while (false)
