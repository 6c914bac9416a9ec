// Checks of our own contracts. A failed check is a bug (exit code 70) and prints expression, place and
// values.
#pragma once

#include <sstream>

#include "io/base/error.h"

#define PIPELINE_CHECK(condition)                                                                 \
  do {                                                                                            \
    if (!(condition)) {                                                                           \
      std::ostringstream message;                                                                 \
      message << "internal error: " << __FILE__ << ":" << __LINE__ << ": " << #condition          \
              << " does not hold";                                                                \
      throw ::io::Error(::io::ExitCode::kInternal, message.str(), "Please report this as a bug"); \
    }                                                                                             \
  } while (false)

#define PIPELINE_CHECK_OP(a, op, b)                                                                         \
  do {                                                                                                      \
    const auto& check_a = (a);                                                                              \
    const auto& check_b = (b);                                                                              \
    if (!(check_a op check_b)) {                                                                            \
      std::ostringstream message;                                                                           \
      message << "internal error: " << __FILE__ << ":" << __LINE__ << ": " << #a << " " << #op << " " << #b \
              << " does not hold (" << check_a << " against " << check_b << ")";                            \
      throw ::io::Error(::io::ExitCode::kInternal, message.str(), "Please report this as a bug");           \
    }                                                                                                       \
  } while (false)

#define PIPELINE_CHECK_EQ(a, b) PIPELINE_CHECK_OP(a, ==, b)
#define PIPELINE_CHECK_LE(a, b) PIPELINE_CHECK_OP(a, <=, b)
#define PIPELINE_CHECK_LT(a, b) PIPELINE_CHECK_OP(a, <, b)
#define PIPELINE_CHECK_GT(a, b) PIPELINE_CHECK_OP(a, >, b)
