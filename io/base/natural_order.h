// The order in which people number their pictures: img2 before img10.
#pragma once

#include <string_view>

namespace io {

// Runs of digits compare by value, everything else by byte; texts of equal value ("1", "01") by length. A
// strict weak order.
bool NaturalLess(std::string_view a, std::string_view b);

}  // namespace io
