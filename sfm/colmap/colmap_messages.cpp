#include "sfm/colmap/colmap_messages.h"

#include "io/base/packed.h"

namespace sfm {

std::string TellMapping(const MappingMessage& message) {
  return io::Packer()
      .Add(message.folder)
      .Add(message.blocks)
      .Add(message.has_images)
      .Add(message.relaxed)
      .Add(message.take_two_view_tracks)
      .Take();
}

MappingMessage ToldMapping(const std::string& bytes) {
  MappingMessage message;
  io::Unpacker told(bytes);
  told.Take(&message.folder);
  told.Take(&message.blocks);
  told.Take(&message.has_images);
  told.Take(&message.relaxed);
  told.Take(&message.take_two_view_tracks);
  return message;
}

}  // namespace sfm
