// What turns an extracted surface into a mesh worth having: loose pieces and unseen faces go, and the rest is
// reduced to a number of triangles.
#pragma once

#include <cstdint>
#include <vector>

#include "io/scene/mesh.h"

namespace nerf {

// Means of the triangles around each vertex, by area, unit length; +z where they cancel out.
std::vector<Eigen::Vector3f> VertexNormals(const io::Mesh& mesh);

// Total area of the triangles.
double Area(const io::Mesh& mesh);

// Drops triangles of which a corner is not kept. keep: [n_vertices].
void KeepVertices(const std::vector<std::uint8_t>& keep, io::Mesh* mesh);

// Drops pieces, connected through shared vertices, that have less than this share of the area of all.
// Returns how many pieces went.
int DropSmallPieces(double least_share, io::Mesh* mesh);

// Collapses edges, those first that change the shape least [Garland and Heckbert 1997, by meshoptimizer],
// down to at most `triangles`, more where the shape would fall apart. Vertices that stay do not move, and
// keep their normals and colours.
void Decimate(std::size_t triangles, io::Mesh* mesh);

// Drops vertices of no triangle; the others keep their order.
void DropUnusedVertices(io::Mesh* mesh);

}  // namespace nerf
