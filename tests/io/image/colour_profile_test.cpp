// What a photo's colour profile is called, and what it means.
#include "io/image/colour_profile.h"

#include <gtest/gtest.h>
#include <lcms2.h>

#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>

#include "io/image/photo.h"

namespace {

// With the primaries of Display P3, whose red, green and blue are beyond sRGB's; or grey.
std::string Profile(const std::string& name, bool grey = false) {
  const cmsCIExyY white{0.3127, 0.3290, 1};
  const cmsCIExyYTRIPLE primaries{{0.680, 0.320, 1}, {0.265, 0.690, 1}, {0.150, 0.060, 1}};
  cmsFloat64Number srgb[] = {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
  cmsToneCurve* curve = cmsBuildParametricToneCurve(nullptr, 4, srgb);
  cmsToneCurve* curves[] = {curve, curve, curve};
  const cmsHPROFILE profile =
      grey ? cmsCreateGrayProfile(&white, curve) : cmsCreateRGBProfile(&white, &primaries, curves);
  cmsMLU* text = cmsMLUalloc(nullptr, 1);
  cmsMLUsetASCII(text, "en", "US", name.c_str());
  cmsWriteTag(profile, cmsSigProfileDescriptionTag, text);
  cmsUInt32Number size = 0;
  cmsSaveProfileToMem(profile, nullptr, &size);
  std::string icc(size, '\0');
  cmsSaveProfileToMem(profile, icc.data(), &size);
  cmsMLUfree(text);
  cmsCloseProfile(profile);
  cmsFreeToneCurve(curve);
  return icc;
}

TEST(ColourProfile, ForeignProfilesAreNamed) {
  EXPECT_EQ(io::ForeignProfileName(Profile("Display P3")), "Display P3");
  EXPECT_EQ(io::ForeignProfileName(Profile("sRGB IEC61966-2.1")), "");
  EXPECT_EQ(io::ForeignProfileName(Profile(std::string(500, 'x'))), std::string(63, 'x'));
  EXPECT_EQ(io::ForeignProfileName(Profile("caf\xe9\n")), "caf");
  EXPECT_EQ(io::ForeignProfileName(Profile("\n")), "unnamed");
  EXPECT_EQ(io::ForeignProfileName("x"), "unnamed");
  EXPECT_EQ(io::ForeignProfileName(""), "");
}

TEST(ColourProfile, ColoursBecomeThoseOfSrgb) {
  for (const int channels : {3, 4}) {
    io::Image image = io::MakeImage(3, 1, channels);
    const std::uint8_t colours[3][4] = {{120, 120, 120, 7}, {234, 51, 35, 100}, {0, 255, 0, 255}};
    for (int x = 0; x < 3; ++x) std::copy_n(colours[x], channels, image.Pixel(x, 0));
    ASSERT_TRUE(io::ConvertToSrgb(Profile("P3"), &image));
    // P3's (234, 51, 35) is sRGB's red; its green is beyond sRGB's.
    const std::uint8_t expected[3][4] = {{120, 120, 120, 7}, {255, 0, 0, 100}, {0, 255, 0, 255}};
    for (int x = 0; x < 3; ++x) {
      for (int i = 0; i < channels; ++i)
        EXPECT_NEAR(image.Pixel(x, 0)[i], expected[x][i], i < 3 ? 3 : 0) << x;
    }
  }
}

TEST(ColourProfile, WhatIsNoProfileOfRgbChangesNothing) {
  for (const std::string& icc :
       {std::string(), std::string("x"), Profile("grey", true), Profile("P3").substr(0, 200)}) {
    io::Image image = io::MakeImage(2, 2, 3);
    image.data[4] = 9;
    const std::vector<std::uint8_t> before = image.data;
    EXPECT_FALSE(io::ConvertToSrgb(icc, &image));
    EXPECT_EQ(image.data, before);
  }
}

TEST(ColourProfile, OfAPhotoItIsAppliedAndSaid) {
  const std::string icc = Profile("Display P3");
  for (const char* extension : {".jpg", ".png"}) {
    std::vector<std::uint8_t> plain;
    cv::imencode(extension, cv::Mat(32, 48, CV_8UC3, cv::Scalar(35, 51, 234)), plain);
    const auto file = Exiv2::ImageFactory::open(plain.data(), static_cast<long>(plain.size()));
    file->readMetadata();
    Exiv2::DataBuf profile(reinterpret_cast<const Exiv2::byte*>(icc.data()), static_cast<long>(icc.size()));
    file->setIccProfile(profile);
    file->writeMetadata();
    Exiv2::BasicIo& bytes = file->io();
    const io::Photo photo =
        io::DecodePhoto({reinterpret_cast<const char*>(bytes.mmap()), bytes.size()}, 1600);
    EXPECT_NEAR(photo.image.Pixel(20, 20)[0], 255, 4) << extension;
    EXPECT_NEAR(photo.image.Pixel(20, 20)[1], 0, 12) << extension;
    ASSERT_EQ(photo.notes.size(), 1u) << extension;
    EXPECT_EQ(photo.notes[0], "colour profile 'Display P3': colours converted to sRGB");
  }
}

}  // namespace
