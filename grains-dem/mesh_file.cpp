#include "mesh_file.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

#include "vector.hpp"

namespace estuary::grains {
namespace {

constexpr std::size_t kHeader = 84;       // of a binary file: 80 characters and the number of triangles
constexpr std::size_t kPerTriangle = 50;  // normal, three corners, two bytes of attributes
constexpr std::size_t kMostTriangles = 20'000'000;

using Corner = std::array<double, 3>;

bool has_area(const Corner& a, const Corner& b, const Corner& c) {
  return norm(arm_times_force(b - a, c - a)) > 0;
}

std::vector<Corner> binary_corners(const std::string& bytes, std::size_t triangles) {
  std::vector<Corner> corners;
  corners.reserve(3 * triangles);
  for (std::size_t t = 0; t < triangles; ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      std::array<float, 3> place{};
      std::memcpy(place.data(), bytes.data() + kHeader + kPerTriangle * t + 12 + 12 * k, sizeof place);
      corners.push_back({place[0], place[1], place[2]});
    }
  return corners;
}

std::vector<Corner> text_corners(const std::string& bytes) {
  std::vector<Corner> corners;
  std::istringstream in(bytes);
  std::string word;
  while (in >> word) {
    if (word != "vertex") continue;
    Corner corner{};
    if (!(in >> corner[0] >> corner[1] >> corner[2]))
      throw std::invalid_argument(fmt::format("corner {} is no three numbers", corners.size()));
    corners.push_back(corner);
  }
  return corners;
}

std::vector<Corner> corners_of(const std::string& bytes) {
  if (bytes.size() >= kHeader) {
    std::uint32_t triangles = 0;  // little-endian, as this machine's
    std::memcpy(&triangles, bytes.data() + 80, sizeof triangles);
    if (bytes.size() == kHeader + kPerTriangle * triangles) return binary_corners(bytes, triangles);
  }
  if (bytes.starts_with("solid")) return text_corners(bytes);
  throw std::invalid_argument("neither a text nor a binary STL file");
}

}  // namespace

TriangleMesh read_stl(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::invalid_argument(fmt::format("cannot read the mesh '{}'", file.string()));
  return stl_of({std::istreambuf_iterator<char>(in), {}}, file);
}

TriangleMesh stl_of(const std::string& bytes, const std::filesystem::path& file) {
  TriangleMesh mesh;
  try {
    const std::vector<Corner> corners = corners_of(bytes);
    if (corners.size() % 3 != 0) throw std::invalid_argument("the last triangle is incomplete");
    if (corners.size() / 3 > kMostTriangles) throw std::invalid_argument("more than 20 million triangles");
    std::map<Corner, std::uint32_t> known;
    for (std::size_t t = 0; t + 2 < corners.size(); t += 3) {
      for (std::size_t k = 0; k < 3; ++k)
        for (const double x : corners[t + k])
          if (!std::isfinite(x)) throw std::invalid_argument(fmt::format("triangle {} is not finite", t / 3));
      if (!has_area(corners[t], corners[t + 1], corners[t + 2])) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [place, is_new] =
            known.try_emplace(corners[t + k], static_cast<std::uint32_t>(known.size()));
        if (is_new) mesh.node.insert(mesh.node.end(), corners[t + k].begin(), corners[t + k].end());
        mesh.triangle.push_back(place->second);
      }
    }
    check_mesh(mesh);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{}: {}", file.string(), error.what()));
  }
  return mesh;
}

void check_mesh(const TriangleMesh& mesh) {
  if (mesh.triangle.size() < 3) throw std::invalid_argument("holds no triangle");
  for (const double x : mesh.node)
    if (!std::isfinite(x)) throw std::invalid_argument("a node is not finite");
  const auto corner = [&](std::size_t k) { return load<3>(mesh.node.data(), mesh.triangle[k]); };
  for (std::size_t t = 0; t + 2 < mesh.triangle.size(); t += 3)
    if (!has_area(corner(t), corner(t + 1), corner(t + 2)))
      throw std::invalid_argument(fmt::format("triangle {} has no area", t / 3));
}

}  // namespace estuary::grains
