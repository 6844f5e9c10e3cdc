// Meshes of triangles in STL files (3D Systems 1989), text or binary: what every CAD program writes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace estuary::grains {

struct TriangleMesh {
  std::vector<double> node;             // three numbers each [m]
  std::vector<std::uint32_t> triangle;  // three nodes each
};

/// Corners in the same place become one node; triangles without area are left out. Throws
/// std::invalid_argument naming the file and what is wrong with it.
TriangleMesh read_stl(const std::filesystem::path& file);
/// The same of a file's content.
TriangleMesh stl_of(const std::string& bytes, const std::filesystem::path& file);

/// Throws std::invalid_argument for a triangle without area or with a node that is not finite, and when there
/// is none.
void check_mesh(const TriangleMesh& mesh);

}  // namespace estuary::grains
