#include <libheif/heif.h>

#include <cstring>
#include <memory>

#include "io/base/error.h"
#include "io/image/photo_codecs.h"

namespace io {
namespace {

void Check(const heif_error& error) {
  if (error.code != heif_error_Ok)
    throw Error(ExitCode::kBadInput, std::string("HEIC cannot be decoded (") + error.message + ")");
}

void ReadExif(const heif_image_handle* handle, PhotoTags* tags) {
  heif_item_id id;
  if (heif_image_handle_get_list_of_metadata_block_IDs(handle, "Exif", &id, 1) != 1) return;
  std::string block(heif_image_handle_get_metadata_size(handle, id), '\0');
  // The block starts with the big-endian offset of the TIFF header behind these four bytes (ISO/IEC
  // 23008-12).
  if (block.size() < 4 || heif_image_handle_get_metadata(handle, id, block.data()).code != heif_error_Ok)
    return;
  std::size_t offset = 0;
  for (std::size_t i = 0; i < 4; ++i) offset = offset << 8 | static_cast<unsigned char>(block[i]);
  if (offset < block.size() - 4) *tags = ParseExif(std::string_view(block).substr(4 + offset));
}

void ReadProfile(const heif_image_handle* handle, PhotoTags* tags) {
  const heif_color_profile_type type = heif_image_handle_get_color_profile_type(handle);
  if (type != heif_color_profile_type_prof && type != heif_color_profile_type_rICC) return;
  std::string icc(heif_image_handle_get_raw_color_profile_size(handle), '\0');
  if (heif_image_handle_get_raw_color_profile(handle, icc.data()).code == heif_error_Ok) tags->icc = icc;
}

}  // namespace

Image DecodeHeif(std::string_view file, PhotoTags* tags, std::vector<std::string>* notes) {
  const std::unique_ptr<heif_context, decltype(&heif_context_free)> heif(heif_context_alloc(),
                                                                         heif_context_free);
  Check(heif_context_read_from_memory_without_copy(heif.get(), file.data(), file.size(), nullptr));
  heif_image_handle* raw_handle = nullptr;
  Check(heif_context_get_primary_image_handle(heif.get(), &raw_handle));
  const std::unique_ptr<heif_image_handle, decltype(&heif_image_handle_release)> handle(
      raw_handle, heif_image_handle_release);
  CheckPhotoSize(heif_image_handle_get_width(raw_handle), heif_image_handle_get_height(raw_handle));
  if (heif_context_get_number_of_top_level_images(heif.get()) > 1) {
    notes->push_back("several pictures in the file: the primary one is used");
  }
  const bool has_alpha = heif_image_handle_has_alpha_channel(raw_handle);
  const std::unique_ptr<heif_decoding_options, decltype(&heif_decoding_options_free)> options(
      heif_decoding_options_alloc(), heif_decoding_options_free);
  options->convert_hdr_to_8bit = true;
  heif_image* raw_image = nullptr;
  Check(heif_decode_image(raw_handle,
                          &raw_image,
                          heif_colorspace_RGB,
                          has_alpha ? heif_chroma_interleaved_RGBA : heif_chroma_interleaved_RGB,
                          options.get()));
  const std::unique_ptr<heif_image, decltype(&heif_image_release)> decoded(raw_image, heif_image_release);
  int stride = 0;
  const std::uint8_t* plane = heif_image_get_plane_readonly(raw_image, heif_channel_interleaved, &stride);
  if (!plane) throw Error(ExitCode::kBadInput, "HEIC holds no colour picture");

  Image image = MakeImage(heif_image_get_width(raw_image, heif_channel_interleaved),
                          heif_image_get_height(raw_image, heif_channel_interleaved),
                          has_alpha ? 4 : 3);
  const auto row_bytes = static_cast<std::size_t>(std::ptrdiff_t{image.width} * image.channels);
  for (int y = 0; y < image.height; ++y) {
    std::memcpy(image.Pixel(0, y), plane + std::ptrdiff_t{y} * stride, row_bytes);
  }
  ReadExif(raw_handle, tags);
  ReadProfile(raw_handle, tags);
  tags->orientation = 1;
  return image;
}

}  // namespace io
