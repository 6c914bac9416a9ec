// ICC profiles: what the numbers of a photo mean.
#pragma once

#include <string>
#include <string_view>

#include "io/image/image.h"

namespace io {

// The 'desc' text of an ICC profile, or "unnamed"; empty when there is none or it is sRGB.
std::string ForeignProfileName(std::string_view icc);

// From the profile's colours to sRGB, relative to white; what lies outside sRGB's gamut is clipped. False,
// and nothing done, when the profile cannot be used or is not one of RGB pictures. Alpha stays.
bool ConvertToSrgb(std::string_view icc, Image* image);

}  // namespace io
