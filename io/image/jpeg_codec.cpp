#include <csetjmp>
#include <cstdio>
// jpeglib.h needs FILE and size_t declared before it.
#include <jpeglib.h>

#include <jerror.h>

#include "io/base/error.h"
#include "io/image/photo_codecs.h"

namespace io {
namespace {

// Some cameras pad the end of the picture data by a few bytes; a decoder that lost its place in damaged data
// leaves hundreds.
constexpr int kMaxPaddingBytes = 32;

struct JpegState {
  jpeg_error_mgr errors;  // first: libjpeg hands a pointer to it back
  std::jmp_buf escape;
  jpeg_decompress_struct jpeg;
  std::string damage;  // first warning that means lost picture data
  std::string fatal;
};

std::string MessageOf(j_common_ptr info) {
  char text[JMSG_LENGTH_MAX];
  info->err->format_message(info, text);
  return text;
}

void OnFatal(j_common_ptr info) {
  auto* state = reinterpret_cast<JpegState*>(info->err);
  state->fatal = MessageOf(info);
  std::longjmp(state->escape, 1);
}

void OnMessage(j_common_ptr info, int level) {
  if (level >= 0) return;  // trace output
  auto* state = reinterpret_cast<JpegState*>(info->err);
  switch (info->err->msg_code) {
    case JWRN_EXTRANEOUS_DATA:
      if (info->err->msg_parm.i[0] <= kMaxPaddingBytes) return;
      [[fallthrough]];
    case JWRN_JPEG_EOF:
    case JWRN_HIT_MARKER:
    case JWRN_HUFF_BAD_CODE:
    case JWRN_ARITH_BAD_CODE:
    case JWRN_MUST_RESYNC:
      if (state->damage.empty()) state->damage = MessageOf(info);
      break;
    default:  // odd headers: the pixels are whole
      break;
  }
}

// Returns false when the header is read but the size is out of bounds. Holds no object with a destructor: a
// fatal error leaves it through longjmp.
bool ReadPixels(JpegState* state, std::string_view file, Image* image) {
  jpeg_decompress_struct& jpeg = state->jpeg;
  if (setjmp(state->escape) != 0) return true;
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(file.data()), file.size());
  jpeg_read_header(&jpeg, TRUE);
  if (jpeg.image_width > kMaxPhotoSide || jpeg.image_height > kMaxPhotoSide ||
      1.0 * jpeg.image_width * jpeg.image_height > kMaxPhotoPixels) {
    return false;
  }
  const bool is_cmyk = jpeg.num_components == 4;
  jpeg.out_color_space = is_cmyk ? JCS_CMYK : JCS_RGB;
  jpeg_start_decompress(&jpeg);
  *image = MakeImage(
      static_cast<int>(jpeg.output_width), static_cast<int>(jpeg.output_height), jpeg.output_components);
  while (jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW row = image->Pixel(0, static_cast<int>(jpeg.output_scanline));
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_decompress(&jpeg);
  return true;
}

// Adobe programs store ink inverted (255 = none). Without a press profile the product of paper and key is
// the usual approximation.
Image RgbFromCmyk(const Image& cmyk, bool is_inverted) {
  Image rgb = MakeImage(cmyk.width, cmyk.height, 3);
  for (std::size_t i = 0; i < rgb.data.size() / 3; ++i) {
    const auto light = [&](std::size_t c) {
      const int stored = cmyk.data[4 * i + c];
      return is_inverted ? stored : 255 - stored;
    };
    for (std::size_t c = 0; c < 3; ++c) {
      rgb.data[3 * i + c] = static_cast<std::uint8_t>((light(c) * light(3) + 127) / 255);
    }
  }
  return rgb;
}

}  // namespace

Image DecodeJpeg(std::string_view file, std::vector<std::string>* notes) {
  JpegState state = {};
  state.jpeg.err = jpeg_std_error(&state.errors);
  state.errors.error_exit = OnFatal;
  state.errors.emit_message = OnMessage;
  Image image;
  const bool size_ok = ReadPixels(&state, file, &image);
  const double width = state.jpeg.image_width, height = state.jpeg.image_height;
  const J_COLOR_SPACE space = state.jpeg.jpeg_color_space;
  const bool is_adobe = state.jpeg.saw_Adobe_marker;
  jpeg_destroy_decompress(&state.jpeg);
  if (!state.fatal.empty()) throw Error(ExitCode::kBadInput, "not a whole JPEG (" + state.fatal + ")");
  if (!size_ok) CheckPhotoSize(width, height);
  if (!state.damage.empty()) {
    throw Error(ExitCode::kBadInput, "truncated or damaged JPEG (" + state.damage + ")");
  }
  if (space == JCS_GRAYSCALE) notes->push_back("grey expanded to RGB");
  if (image.channels == 4) {
    notes->push_back("CMYK converted to RGB without its press profile");
    image = RgbFromCmyk(image, is_adobe);
  }
  return image;
}

}  // namespace io
