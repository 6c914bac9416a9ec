// What the numbers of a video's frames mean, and their conversion to sRGB.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "io/image/image.h"

namespace io {

// As ffprobe names them (ITU-T H.273); empty or "unknown": not said.
struct VideoColours {
  std::string matrix, transfer, primaries;
};

// To sRGB, from R'G'B' that a decoder made of Y'CbCr by the matrix of BT.601 whatever the file says, as
// OpenCV does:
// - R'G'B' by the file's own matrix. Where it names none, a shorter side of more than 576 has that of BT.709.
// - HDR (HLG with a system gamma of 1.2, or PQ; ITU-R BT.2100): the light of a display of 1000 cd/m^2. The
//   largest of R, G and B is brought to at most 203 cd/m^2, the white of BT.2408 [EETF of ITU-R BT.2390]: up
//   to 92 cd/m^2 nothing changes, 203 becomes 230 of 255.
// - The primaries of BT.2020 and P3 become those of sRGB; colours beyond these are clipped.
class ColourConversion {
 public:
  using Colour = std::array<double, 3>;  // R'G'B' in [0, 1]

  ColourConversion(const VideoColours& colours, int shorter_side);

  bool IsHdr() const { return transfer_ != Transfer::kSdr; }
  // Whether any colour changes.
  bool Converts() const { return converts_; }

  // One colour.
  Colour Exact(const Colour& decoded) const;
  // All pixels of an RGB picture, from tables: at most 3.5 of 255 beside Exact's values where a channel
  // nearly vanishes, 0.3 in the mean, of which rounding to 8 bits is 0.25.
  void Convert(Image* image) const;

 private:
  enum class Transfer { kSdr, kHlg, kPq };
  using Matrix = std::array<double, 9>;

  // Linear light of a signal, the peak's being 1: the display's, of HLG the scene's.
  double Light(double signal) const;

  Matrix signal_{}, primaries_{};
  Transfer transfer_ = Transfer::kSdr;
  bool wide_ = false;  // other primaries than those of sRGB
  bool converts_ = false;
  // Functions of [0, 1]; empty where light stays as it is.
  std::vector<float> light_;         // of the signal
  std::vector<float> gamma_, tone_;  // gains, of the fourth root of luminance and of light
  std::vector<float> encode_;        // sRGB in [0, 255], of the square root of light
};

}  // namespace io
