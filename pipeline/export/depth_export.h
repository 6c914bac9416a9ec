// Depth, normals and support of every training and test view as PNG files of the pictures' size:
//   depth/NAME    16 bits: distance along the optical axis, in steps that depth.json states; 0: no surface
//   normals/NAME  8-bit RGB: 127.5 (n + 1) of the unit normal in the camera's OpenGL axes (x right, y up, z
//                 back); black: unknown
//   support/NAME  8 bits: how many training views saw the same surface, 255 for more; 0 where there is none
#pragma once

#include <filesystem>

#include "pipeline/export/exported_scene.h"

namespace pipeline {

// Needs scene.field. Throws kNoResources and io::Interrupted.
void ExportDepth(const ExportedScene& scene, const std::filesystem::path& folder);

}  // namespace pipeline
