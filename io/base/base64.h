// Bytes as text that a web page can carry.
#pragma once

#include <string>
#include <string_view>

namespace io {

// RFC 4648, with padding.
std::string Base64(std::string_view bytes);

}  // namespace io
