// What the server says and is told, apart from how it travels.
#pragma once

#include <functional>
#include <string>
#include "io/base/json.h"

#include "pipeline/view/frame_maker.h"
#include "pipeline/view/live_run.h"

namespace pipeline {

// Value of a request's parameter, empty when it is not given.
using Parameters = std::function<std::string(const std::string& name)>;

// Throws kBadInput naming the parameter that is missing or out of range.
FrameRequest ParseFrameRequest(const Parameters& parameters);

// Longest side of a picture that a page may ask for, and most pixels: 4K.
inline constexpr int kMaxViewSide = 4096;
inline constexpr int kMaxViewPixels = 3840 * 2160;

// Tells a training that somebody looks.
io::Json StateJson(const LiveRun& run);

// The photograph of a training view as JPEG. Throws kBadInput for an index that the scene does not have.
std::vector<std::uint8_t> PhotoJpeg(const LiveRun::Content& content, const std::string& index);

// The frames of a camera_path.json; `save` writes it to RUN/camera_path.json. Throws kBadInput.
io::Json AnswerPath(const std::filesystem::path& run_folder, const std::string& body, bool save);

}  // namespace pipeline
