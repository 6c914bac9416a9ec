#include "sfm/colmap/colmap_messages.h"

#include "io/base/packed.h"

namespace sfm {

std::string TellVerifying(const std::string& folder,
                          const CapturedViews& views,
                          const std::vector<std::vector<PairMatches>>& shards) {
  io::Packer told;
  told.Add(folder).Add(views.names).Add(views.camera_model).Add(views.groups.size());
  for (const CameraGroup& group : views.groups)
    told.Add(group.names).Add(group.width).Add(group.height).Add(group.focal_px);
  for (const Features& of : views.features) told.Add(of.keypoints);
  told.Add(shards.size());
  for (const std::vector<PairMatches>& shard : shards) {
    told.Add(shard.size());
    for (const PairMatches& pair : shard) told.Add(pair.a).Add(pair.b).Add(pair.matches);
  }
  return told.Take();
}

VerifyingMessage ToldVerifying(const std::string& bytes) {
  VerifyingMessage message;
  CapturedViews& views = message.views;
  io::Unpacker told(bytes);
  told.Take(&message.folder);
  told.Take(&views.names);
  told.Take(&views.camera_model);
  views.groups.resize(told.Take<std::size_t>());
  for (CameraGroup& group : views.groups) {
    told.Take(&group.names);
    told.Take(&group.width);
    told.Take(&group.height);
    told.Take(&group.focal_px);
  }
  views.features.resize(views.names.size());
  for (Features& of : views.features) told.Take(&of.keypoints);
  message.shards.resize(told.Take<std::size_t>());
  for (std::vector<PairMatches>& shard : message.shards) {
    shard.resize(told.Take<std::size_t>());
    for (PairMatches& pair : shard) {
      told.Take(&pair.a);
      told.Take(&pair.b);
      told.Take(&pair.matches);
    }
  }
  return message;
}

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
