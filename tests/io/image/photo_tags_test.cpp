// What a photo's colour profile is called.
#include "io/image/photo_tags.h"

#include <gtest/gtest.h>

namespace {

TEST(PhotoTags, ForeignProfilesAreNamed) {
  std::string icc(128, '\0');
  icc += std::string("\0\0\0\1desc\0\0\0\x90\0\0\0\x20", 16);
  std::string text = std::string("desc\0\0\0\0\0\0\0\x0b", 12) + "Display P3";
  text.resize(0x20);
  EXPECT_EQ(io::ForeignProfileName(icc + text), "Display P3");
  text.replace(12, 10, "sRGB IEC61");
  EXPECT_EQ(io::ForeignProfileName(icc + text), "");
  EXPECT_EQ(io::ForeignProfileName(icc), "unnamed");
}

}  // namespace
