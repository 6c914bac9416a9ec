// Takes the overlay out of a capture's pictures: they lose their bars, and masks leave out its marks.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "io/image/image.h"
#include "pipeline/ingest/ingest.h"

namespace pipeline {

class OverlayRemoval {
 public:
  explicit OverlayRemoval(std::size_t n_pictures) : n_pictures_(n_pictures) {}

  // What it keeps at most of so many pictures whose longest side is max_side.
  static std::size_t Bytes(std::size_t n_pictures, int max_side);

  // Keeps picture `index` small, where it is among those that are compared. Any thread.
  void Look(std::size_t index, const std::string& name, const io::Image& picture);

  // Crops the kept pictures in folder/images and writes their masks to folder/masks; size by size, each with
  // an overlay of its own. Says so in report->decisions.
  void Apply(const std::filesystem::path& folder, int threads, IngestReport* report) const;

 private:
  std::size_t n_pictures_;
  std::mutex mutex_;
  std::map<std::string, io::Image> looks_;  // by name
};

}  // namespace pipeline
