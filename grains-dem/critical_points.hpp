// Critical points of the distance from a grain's centre to a polyline or mesh (walls.hpp).
#pragma once

#include "walls.hpp"

namespace estuary::grains {

template <int D>
struct CriticalPoint {
  double index = 1, overlap = 0;
  Vector<D> normal{}, velocity{};
  std::uint32_t element = 0, piece = 0;
  // Of a polyline: the nodes, and the share of the second.
  std::uint32_t first = 0, second = 0;
  double share = 0;
};

// Kept from call to call: no allocation once it has grown.
template <int D>
struct CriticalPoints {
  std::vector<CriticalPoint<D>> points;
  std::vector<std::uint32_t> piece;  // of each near facet; kNoElement beyond the grain's radius
};

/// Those within the radius `r` of x, among the facets `near`. The result is overwritten by the thread's next
/// call.
const CriticalPoints<2>& critical_points(const Wall<2>& wall, std::span<const std::uint32_t> near,
                                         const Vector<2>& x, double r);
const CriticalPoints<3>& critical_points(const Wall<3>& wall, std::span<const std::uint32_t> near,
                                         const Vector<3>& x, double r);

inline void merge_pieces(std::vector<std::uint32_t>& piece, std::size_t a, std::size_t b) {
  const std::uint32_t from = std::max(piece[a], piece[b]), to = std::min(piece[a], piece[b]);
  std::replace(piece.begin(), piece.end(), from, to);
}

}  // namespace estuary::grains
