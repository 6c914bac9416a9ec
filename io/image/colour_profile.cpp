#include "io/image/colour_profile.h"

#include <lcms2.h>

#include <algorithm>
#include <memory>
#include <type_traits>

namespace io {
namespace {

// LittleCMS with one profile. In a context of its own: threads share nothing.
struct OpenProfile {
  explicit OpenProfile(std::string_view icc)
      : context(cmsCreateContext(nullptr, nullptr), cmsDeleteContext),
        profile(cmsOpenProfileFromMemTHR(context.get(), icc.data(), static_cast<cmsUInt32Number>(icc.size())),
                cmsCloseProfile) {}

  std::unique_ptr<std::remove_pointer_t<cmsContext>, decltype(&cmsDeleteContext)> context;
  std::unique_ptr<void, decltype(&cmsCloseProfile)> profile;
};

}  // namespace

std::string ForeignProfileName(std::string_view icc) {
  if (icc.empty()) return "";
  const OpenProfile open(icc);
  char text[64] = "";
  if (open.profile)
    cmsGetProfileInfoASCII(open.profile.get(), cmsInfoDescription, "en", "US", text, sizeof text);
  std::string name = text;
  std::erase_if(name, [](char c) { return c < ' ' || c > '~'; });
  if (name.find("sRGB") != std::string::npos) return "";
  return name.empty() ? "unnamed" : name;
}

bool ConvertToSrgb(std::string_view icc, Image* image) {
  const OpenProfile open(icc);
  if (!open.profile || cmsGetColorSpace(open.profile.get()) != cmsSigRgbData) return false;
  const std::unique_ptr<void, decltype(&cmsCloseProfile)> srgb(cmsCreate_sRGBProfileTHR(open.context.get()),
                                                               cmsCloseProfile);
  const cmsUInt32Number format = image->channels == 4 ? TYPE_RGBA_8 : TYPE_RGB_8;
  const std::unique_ptr<void, decltype(&cmsDeleteTransform)> transform(
      cmsCreateTransformTHR(open.context.get(),
                            open.profile.get(),
                            format,
                            srgb.get(),
                            format,
                            INTENT_RELATIVE_COLORIMETRIC,
                            0),
      cmsDeleteTransform);
  if (!transform) return false;
  for (int y = 0; y < image->height; ++y) {  // in place, which leaves alpha
    std::uint8_t* row = image->Pixel(0, y);
    cmsDoTransform(transform.get(), row, row, static_cast<cmsUInt32Number>(image->width));
  }
  return true;
}

}  // namespace io
