// Compressed bytes as browsers read them.
#pragma once

#include <string>
#include <string_view>

namespace io {

// RFC 1952.
std::string Gzip(std::string_view bytes);

}  // namespace io
