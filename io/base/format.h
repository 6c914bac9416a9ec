// printf into a std::string: GCC 12 of Debian 12 has no std::format.
#pragma once

#include <string>

namespace io {

// The arguments are checked against `format` at compile time.
[[gnu::format(printf, 1, 2)]] std::string Format(const char* format, ...);

}  // namespace io
