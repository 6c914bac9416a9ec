#include "io/video/video_colours.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace io {
namespace {

constexpr int kLargestBt601 = 576;            // [px] shorter side of television before HD
constexpr double kPeak = 1000, kWhite = 203;  // [cd/m^2]
constexpr double kSystemGamma = 1.2;          // of HLG on a display of kPeak
constexpr int kIntervals = 4096;              // of a table

// Weights of red and blue in luma (ITU-T H.273, table 4).
struct Luma {
  double red, blue;
  constexpr double green() const { return 1 - red - blue; }
};
constexpr Luma kBt601{0.299, 0.114}, kBt709{0.2126, 0.0722}, kBt2020{0.2627, 0.0593};

cv::Matx33d FromYCbCr(const Luma& luma) {
  const double cr = 2 * (1 - luma.red), cb = 2 * (1 - luma.blue);
  return {1, 0, cr, 1, -cb * luma.blue / luma.green(), -cr * luma.red / luma.green(), 1, cb, 0};
}

// Chromaticities (x, y) of red, green and blue (ITU-T H.273, table 2); white is D65.
struct Primaries {
  double xr, yr, xg, yg, xb, yb;
};
constexpr Primaries kSrgb{0.640, 0.330, 0.300, 0.600, 0.150, 0.060};
constexpr Primaries kWide{0.708, 0.292, 0.170, 0.797, 0.131, 0.046};  // BT.2020
constexpr Primaries kP3{0.680, 0.320, 0.265, 0.690, 0.150, 0.060};

cv::Matx33d XyzFromRgb(const Primaries& p) {
  const auto z = [](double x, double y) { return (1 - x - y) / y; };
  constexpr double kWhiteX = 0.3127, kWhiteY = 0.3290;
  const cv::Matx33d xyz(
      p.xr / p.yr, p.xg / p.yg, p.xb / p.yb, 1, 1, 1, z(p.xr, p.yr), z(p.xg, p.yg), z(p.xb, p.yb));
  const cv::Vec3d white(kWhiteX / kWhiteY, 1, z(kWhiteX, kWhiteY));
  return xyz * cv::Matx33d::diag(xyz.inv() * white);
}

// IEC 61966-2-1.
double FromSrgb(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }
double ToSrgb(double v) { return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055; }

// The scene's light in [0, 1] (BT.2100, table 5).
double FromHlg(double v) {
  constexpr double a = 0.17883277, b = 0.28466892, c = 0.55991073;
  return v <= 0.5 ? v * v / 3 : (std::exp((v - c) / a) + b) / 12;
}

// The display's light in cd/m^2 (BT.2100, table 4).
constexpr double kM1 = 2610.0 / 16384, kM2 = 2523.0 / 32;
constexpr double kC1 = 3424.0 / 4096, kC2 = 2413.0 / 128, kC3 = 2392.0 / 128;

double FromPq(double v) {
  const double power = std::pow(v, 1 / kM2);
  return 10000 * std::pow(std::max(power - kC1, 0.0) / (kC2 - kC3 * power), 1 / kM1);
}

double ToPq(double light) {
  const double power = std::pow(light / 10000, kM1);
  return std::pow((kC1 + kC2 * power) / (1 + kC3 * power), kM2);
}

// The light of a display over that of the scene, both in [0, 1], for the scene's luminance.
double HlgGain(double luminance) { return std::pow(luminance, kSystemGamma - 1); }

// What brings light of [0, kPeak] cd/m^2, given as [0, 1], to that of [0, kWhite], given as [0, 1]: in PQ, a
// cubic above the knee.
double ToneGain(double light) {
  const double peak = ToPq(kPeak), most = ToPq(kWhite) / peak, knee = 1.5 * most - 0.5;
  const double e = ToPq(light * kPeak) / peak;
  if (e <= knee) return kPeak / kWhite;
  const double t = (std::min(e, 1.0) - knee) / (1 - knee), t2 = t * t, t3 = t2 * t;
  const double mapped =
      (2 * t3 - 3 * t2 + 1) * knee + (t3 - 2 * t2 + t) * (1 - knee) + (3 * t2 - 2 * t3) * most;
  return FromPq(peak * mapped) / kWhite / light;
}

float FourthRoot(float v) { return std::sqrt(std::sqrt(v)); }

// Values of a function of [0, 1] at even places.
template <typename Function>
std::vector<float> TableOf(const Function& function) {
  std::vector<float> table(kIntervals + 1);
  for (int i = 0; i <= kIntervals; ++i)
    table[static_cast<std::size_t>(i)] = static_cast<float>(function(static_cast<double>(i) / kIntervals));
  return table;
}

// The value at the nearest place.
float At(const std::vector<float>& table, float v) {
  return table[static_cast<std::size_t>(cvRound(std::clamp(v, 0.f, 1.f) * kIntervals))];
}

std::array<double, 9> Elements(const cv::Matx33d& matrix) { return std::to_array(matrix.val); }

template <typename T>
inline std::array<T, 3> Times(const std::array<T, 9>& m, const std::array<T, 3>& v) {
  return {m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
          m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
          m[6] * v[0] + m[7] * v[1] + m[8] * v[2]};
}

std::array<float, 9> InFloat(const std::array<double, 9>& matrix) {
  std::array<float, 9> rounded;
  std::transform(
      matrix.begin(), matrix.end(), rounded.begin(), [](double v) { return static_cast<float>(v); });
  return rounded;
}

// Of light by BT.2020's primaries; its first row.
constexpr std::array<double, 9> kLuminance{kBt2020.red, kBt2020.green(), kBt2020.blue};

const Luma& LumaOf(const std::string& matrix, int shorter_side) {
  if (matrix == "bt709") return kBt709;
  if (matrix == "bt2020nc" || matrix == "bt2020c") return kBt2020;
  const bool is_said = !matrix.empty() && matrix != "unknown";
  return is_said || shorter_side <= kLargestBt601 ? kBt601 : kBt709;
}

}  // namespace

ColourConversion::ColourConversion(const VideoColours& colours, int shorter_side) {
  const Luma& luma = LumaOf(colours.matrix, shorter_side);
  signal_ = Elements(FromYCbCr(luma) * FromYCbCr(kBt601).inv());
  if (colours.transfer == "arib-std-b67") transfer_ = Transfer::kHlg;
  if (colours.transfer == "smpte2084") transfer_ = Transfer::kPq;
  const bool is_p3 = colours.primaries == "smpte432";
  wide_ = is_p3 || colours.primaries == "bt2020";
  if (wide_) primaries_ = Elements(XyzFromRgb(kSrgb).inv() * XyzFromRgb(is_p3 ? kP3 : kWide));
  converts_ = wide_ || IsHdr() || &luma != &kBt601;
  if (!wide_ && !IsHdr()) return;
  light_ = TableOf([&](double v) { return Light(v); });
  if (transfer_ == Transfer::kHlg) gamma_ = TableOf([](double root) { return HlgGain(std::pow(root, 4)); });
  if (IsHdr()) tone_ = TableOf([](double root) { return ToneGain(std::pow(root, 4)); });
  encode_ = TableOf([](double root) { return 255 * ToSrgb(root * root); });
}

double ColourConversion::Light(double signal) const {
  if (transfer_ == Transfer::kSdr) return FromSrgb(signal);
  return transfer_ == Transfer::kHlg ? FromHlg(signal) : std::min(FromPq(signal) / kPeak, 1.0);
}

ColourConversion::Colour ColourConversion::Exact(const Colour& decoded) const {
  Colour colour = Times(signal_, decoded);
  for (double& v : colour) v = std::clamp(v, 0.0, 1.0);
  if (!wide_ && !IsHdr()) return colour;
  for (double& v : colour) v = Light(v);
  double scale = transfer_ == Transfer::kHlg ? HlgGain(Times(kLuminance, colour)[0]) : 1;
  if (IsHdr()) scale *= ToneGain(scale * std::max({colour[0], colour[1], colour[2]}));
  if (wide_) colour = Times(primaries_, colour);
  for (double& v : colour) v = ToSrgb(std::clamp(scale * v, 0.0, 1.0));
  return colour;
}

void ColourConversion::Convert(Image* image) const {
  if (!converts_) return;
  cv::Mat pixels(image->height, image->width, CV_8UC3, image->data.data());
  if (encode_.empty()) {
    cv::transform(pixels, pixels, cv::Matx33d(signal_.data()));
    return;
  }
  const std::array<float, 9> signal = InFloat(signal_), luminance = InFloat(kLuminance),
                             primaries = InFloat(primaries_);
  pixels.forEach<cv::Vec3b>([&](cv::Vec3b& pixel, const int*) {
    constexpr float kUnit = 1.f / 255;
    std::array<float, 3> colour =
        Times<float>(signal, {kUnit * pixel[0], kUnit * pixel[1], kUnit * pixel[2]});
    for (float& v : colour) v = At(light_, v);
    float scale = 1;
    if (transfer_ == Transfer::kHlg) scale = At(gamma_, FourthRoot(Times(luminance, colour)[0]));
    if (IsHdr()) scale *= At(tone_, FourthRoot(scale * std::max({colour[0], colour[1], colour[2]})));
    if (wide_) colour = Times(primaries, colour);
    for (int i = 0; i < 3; ++i) {
      const float root = std::sqrt(std::max(scale * colour[static_cast<std::size_t>(i)], 0.f));
      pixel[i] = static_cast<std::uint8_t>(cvRound(At(encode_, root)));
    }
  });
}

}  // namespace io
