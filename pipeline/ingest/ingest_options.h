// The options of `pipeline ingest`: flags bound to IngestOptions, and their ranges.
#pragma once

#include <filesystem>
#include <string>

#include "pipeline/ingest/ingest.h"
#include "pipeline/stage/options.h"

namespace pipeline {

struct IngestFlags {
  IngestOptions ingest;
  std::filesystem::path masks;  // folder
  std::string frames;           // "A:B"
};

void AddIngestOptions(Options* options, IngestFlags* flags);

// flags.ingest with the range of flags.frames.
IngestOptions ResolvedIngestOptions(const IngestFlags& flags);

}  // namespace pipeline
