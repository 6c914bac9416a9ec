// A triangle mesh with a colour and a normal per vertex, and the two files that it is written to.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/scene/pose.h"

namespace io {

struct Mesh {
  std::vector<Eigen::Vector3f> positions;               // [n_vertices], in the unit and axes of its scene
  std::vector<Eigen::Vector3f> normals;                 // [n_vertices], unit length, out of the surface
  std::vector<std::array<std::uint8_t, 3>> colours;     // [n_vertices], sRGB
  std::vector<std::array<std::uint32_t, 3>> triangles;  // [n_triangles], counter-clockwise seen from outside
};

// The same mesh in another frame: x_target = target_from_source * x_source.
Mesh TransformedMesh(const Sim3d& target_from_source, Mesh mesh);

// Both writers are atomic, throw kNoResources, and take meshes whose lists have equal length, whose indices
// are in range and whose numbers are finite; anything else is a bug of the caller. z is up, as in a scene.
//
// Binary little-endian PLY: float x, y, z, nx, ny, nz; uchar red, green, blue; faces as lists of int. Axes
// and sRGB colours as they are.
// remark: one line for whoever opens the file, a comment or glTF's generator.
void WriteMeshPly(const std::filesystem::path& path,
                  const Mesh& mesh,
                  const std::string& remark = "pipeline");
// glTF 2.0 in one binary file. There +y is up and colours are linear: (x, y, z) becomes (x, z, -y), and
// COLOR_0 is decoded from sRGB to 16 bits. The material is unlit (KHR_materials_unlit), since the colours
// have the light of the photographs in them, and shows both sides, since the surface may end anywhere.
void WriteMeshGlb(const std::filesystem::path& path,
                  const Mesh& mesh,
                  const std::string& remark = "pipeline");

// Throws kInternal unless the mesh is as the writers take it.
void CheckMesh(const Mesh& mesh);

}  // namespace io
