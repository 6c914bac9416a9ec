#include <cerrno>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "io/base/error.h"
#include "io/base/memory.h"
#include "io/image/media_type.h"
#include "io/image/photo_codecs.h"

namespace io {
namespace {

[[noreturn]] void Refuse(const std::string& reason) { throw Error(ExitCode::kBadInput, reason); }

// Little- or big-endian unsigned number of 1..4 bytes; refuses to read behind the end.
std::uint32_t Number(std::string_view file, std::size_t offset, int bytes, bool big_endian) {
  if (offset > file.size() || file.size() - offset < static_cast<std::size_t>(bytes)) {
    Refuse("the file ends inside its header");
  }
  std::uint32_t value = 0;
  for (int i = 0; i < bytes; ++i) {
    const int at = big_endian ? i : bytes - 1 - i;
    value = value << 8 | static_cast<unsigned char>(file[offset + static_cast<std::size_t>(at)]);
  }
  return value;
}

void CheckPngHeader(std::string_view file) {
  if (file.substr(12, 4) != "IHDR") Refuse("PNG without a header");
  CheckPhotoSize(Number(file, 16, 4, true), Number(file, 20, 4, true));
}

// RFC 9649: a lossy, lossless or extended chunk comes first.
void CheckWebpHeader(std::string_view file) {
  const std::string_view chunk = file.substr(12, 4);
  if (chunk == "VP8X") {
    constexpr std::uint32_t kAnimated = 0x02;
    if (Number(file, 20, 1, false) & kAnimated) Refuse("animated WebP. Convert its pictures to PNG or JPEG");
    CheckPhotoSize(Number(file, 24, 3, false) + 1.0, Number(file, 27, 3, false) + 1.0);
  } else if (chunk == "VP8L") {
    const std::uint32_t bits = Number(file, 21, 4, false);
    CheckPhotoSize((bits & 0x3fff) + 1.0, (bits >> 14 & 0x3fff) + 1.0);
  } else {
    CheckPhotoSize(Number(file, 26, 2, false) & 0x3fff, Number(file, 28, 2, false) & 0x3fff);
  }
}

// What must be changed in a TIFF before OpenCV reads it: values of tags, where they lie in the file.
struct TiffCorrection {
  std::size_t at;
  int bytes;
  std::uint32_t value;
};

// TIFF 6.0, section 2, first directory only.
std::vector<TiffCorrection> CheckTiffHeader(std::string_view file, std::vector<std::string>* notes) {
  constexpr std::uint32_t kSubfileType = 254, kWidth = 256, kHeight = 257, kPhotometric = 262,
                          kOrientation = 274, kRowsPerStrip = 278, kTileWidth = 322, kTileHeight = 323,
                          kDngVersion = 50706;
  constexpr std::uint32_t kShort = 3, kLong = 4, kCmyk = 5, kReducedPicture = 1, kUpright = 1;
  const bool big = file[0] == 'M';
  const std::size_t directory = Number(file, 4, 4, big);
  const std::uint32_t n_entries = Number(file, directory, 2, big);
  double width = 0, height = 0, strip_rows = 0, tile_width = 0, tile_height = 0;
  std::optional<TiffCorrection> rows;
  std::vector<TiffCorrection> corrections;
  // Decoders read further types and the first of several values: sizes that we did not check.
  const auto set_side = [](double* side, std::uint32_t type, double value) {
    if (*side != 0 || (type != kShort && type != kLong)) Refuse("the size in its header is damaged");
    *side = value;
  };
  for (std::uint32_t i = 0; i < n_entries; ++i) {
    const std::size_t entry = directory + 2 + 12 * i;
    const std::uint32_t tag = Number(file, entry, 2, big);
    const std::uint32_t type = Number(file, entry + 2, 2, big);
    const std::uint32_t value = Number(file, entry + 8, type == kShort ? 2 : 4, big);
    if (tag == kWidth) set_side(&width, type, value);
    if (tag == kHeight) set_side(&height, type, value);
    if (tag == kRowsPerStrip) {
      set_side(&strip_rows, type, value);
      rows = {entry + 8, type == kShort ? 2 : 4, 0};
    }
    if (tag == kTileWidth) set_side(&tile_width, type, value);
    if (tag == kTileHeight) set_side(&tile_height, type, value);
    // OpenCV would apply it by halves: it never swaps the sides.
    if (tag == kOrientation) corrections.push_back({entry + 8, 2, kUpright});
    if (tag == kPhotometric && value == kCmyk) Refuse("CMYK TIFF. Convert it to an sRGB PNG or JPEG");
    if (tag == kDngVersion || (tag == kSubfileType && (value & kReducedPicture) != 0)) {
      Refuse("camera raw file. Convert it to PNG or JPEG");
    }
  }
  CheckPhotoSize(width, height);
  // Strips may be higher than the picture, and OpenCV would allocate them so.
  if (rows && strip_rows > height) {
    rows->value = static_cast<std::uint32_t>(height);
    corrections.push_back(*rows);
  }
  // A tile is decoded whole, however little of it the picture needs.
  if (tile_width > 0 || tile_height > 0) CheckPhotoSize(tile_width, tile_height);
  if (Number(file, directory + 2 + 12 * n_entries, 4, big) != 0) {
    notes->push_back("several pages in the file: the first one is used");
  }
  return corrections;
}

}  // namespace

Image DecodeWithOpenCv(std::string_view file, std::vector<std::string>* notes) {
  const MediaType type = MediaTypeOf(file);
  constexpr std::size_t kShortestHeader = 30;  // of those below
  if (type != MediaType::kUnknown && file.size() < kShortestHeader) Refuse("the file ends inside its header");
  // Where the decoder of this type does not want the file, OpenCV asks the others, of which that of DICOM
  // looks at this place alone, and its library ends the program where the rest is damaged.
  constexpr std::size_t kDicomAt = 128;
  constexpr std::string_view kDicom = "DICM";
  if (file.size() > kDicomAt && file.substr(kDicomAt, kDicom.size()) == kDicom)
    Refuse("cannot be told from DICOM");
  if (type == MediaType::kPng) CheckPngHeader(file);
  if (type == MediaType::kWebp) CheckWebpHeader(file);
  std::string corrected;
  if (type == MediaType::kTiff) {
    const std::vector<TiffCorrection> corrections = CheckTiffHeader(file, notes);
    if (!corrections.empty()) corrected = file;
    for (const auto& [at, bytes, value] : corrections) {
      for (int i = 0; i < bytes; ++i) {
        const int shift = 8 * (file[0] == 'M' ? bytes - 1 - i : i);
        corrected[at + static_cast<std::size_t>(i)] = static_cast<char>(value >> shift & 0xff);
      }
    }
    if (!corrections.empty()) file = corrected;
  }

  cv::Mat mat;
  errno = 0;
  try {
    const cv::Mat bytes(1, static_cast<int>(file.size()), CV_8U, const_cast<char*>(file.data()));
    mat = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);  // applies no EXIF orientation of other kinds
  } catch (const cv::Exception&) {
  }
  if (mat.empty()) {
    ThrowIfMemoryWasRefused();
    Refuse(type == MediaType::kUnknown ? "cannot be read as a picture"
                                       : std::string("truncated or damaged ") + MediaTypeName(type));
  }
  if (mat.depth() == CV_16U) {
    mat.convertTo(mat, CV_8U, 1.0 / 257.0);
    notes->push_back("16 bits per channel scaled to 8");
  }
  if (mat.depth() != CV_8U) Refuse("neither 8 nor 16 bits per channel. Convert it to PNG or JPEG");
  if (mat.channels() == 2) Refuse("two channels. Convert it to PNG or JPEG");
  if (mat.channels() == 1) notes->push_back("grey expanded to RGB");
  Image image = MakeImage(mat.cols, mat.rows, mat.channels() == 4 ? 4 : 3);
  cv::Mat target(image.height, image.width, CV_8UC(image.channels), image.data.data());
  cv::cvtColor(mat,
               target,
               mat.channels() == 1   ? cv::COLOR_GRAY2RGB
               : mat.channels() == 4 ? cv::COLOR_BGRA2RGBA
                                     : cv::COLOR_BGR2RGB);
  return image;
}

}  // namespace io
