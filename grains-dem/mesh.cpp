// Critical points of a mesh of triangles: feet on triangles, and edges and nodes that stick out or lie
// between feet. The mesh has no inside: it acts on grains on either side.
//
// All indices follow from two questions, asked in the same way wherever they matter, so that rounding cannot
// make the sum jump: does x project on the triangle's side of its edge (`over`), and not beyond the edge's
// end
// (`along`)?
#include <algorithm>
#include <cmath>

#include "critical_points.hpp"

namespace estuary::grains {
namespace {

Vector<3> node_of(const Wall<3>& wall, std::uint32_t k) {
  return load<3>(wall.node.data(), k);
}

Vector<3> normal_of(const Wall<3>& wall, std::uint32_t f) {
  const Vector<3> a = node_of(wall, wall.facet[3 * f]);
  const Vector<3> n =
      arm_times_force(node_of(wall, wall.facet[3 * f + 1]) - a, node_of(wall, wall.facet[3 * f + 2]) - a);
  return (1 / norm(n)) * n;
}

// x projects on the inner side of edge `k` of triangle `f`.
bool over(const Wall<3>& wall, std::uint32_t f, std::size_t k, const Vector<3>& x) {
  const Vector<3> a = node_of(wall, wall.facet[3 * f + k]);
  const Vector<3> t = node_of(wall, wall.facet[3 * f + (k + 1) % 3]) - a;
  return dot(x - a, arm_times_force(normal_of(wall, f), t)) >= 0;
}

// Where x projects on the edge, of its length.
double fraction_along(const Wall<3>& wall, std::uint32_t e, const Vector<3>& x) {
  const Vector<3> a = node_of(wall, wall.edge[2 * e]), t = node_of(wall, wall.edge[2 * e + 1]) - a;
  return dot(x - a, t) / dot(t, t);
}

// Seen from its node `k`, x projects on the edge's side.
bool along(const Wall<3>& wall, std::uint32_t e, std::uint32_t k, const Vector<3>& x) {
  const double fraction = fraction_along(wall, e, x);
  return wall.edge[2 * e] == k ? fraction >= 0 : fraction <= 1;
}

std::size_t meeting_at_edge(const Wall<3>& wall, std::uint32_t e) {
  return wall.edge_start[e + 1] - wall.edge_start[e];
}

// 1 less the triangles over which one comes nearer to x when leaving the edge.
double index_of_edge(const Wall<3>& wall, std::uint32_t e, const Vector<3>& x) {
  double index = 1;
  for (std::uint32_t m = wall.edge_start[e]; m < wall.edge_start[e + 1]; ++m) {
    const std::uint32_t f = wall.edge_facet[m];
    for (std::size_t k = 0; k < 3; ++k)
      if (wall.facet_edge[3 * f + k] == e && over(wall, f, k, x)) index -= 1;
  }
  return index;
}

// 1 less the Euler characteristic of the directions from the node in which one comes nearer to x: one part
// for each triangle with such a direction, joined along edges. A triangle has one when one of its two edges
// has: its angle is less than half a turn.
double index_of_node(const Wall<3>& wall, std::uint32_t v, const Vector<3>& x) {
  double index = 1;
  for (std::uint32_t m = wall.node_start[v]; m < wall.node_start[v + 1]; ++m) {
    const std::uint32_t f = wall.node_facet[m];
    bool nearer = false;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t e = wall.facet_edge[3 * f + k];
      if (wall.edge[2 * e] != v && wall.edge[2 * e + 1] != v) continue;
      if (!along(wall, e, v, x)) continue;
      nearer = true;
      // Each edge once.
      if (wall.edge_facet[wall.edge_start[e]] == f)
        index += static_cast<double>(meeting_at_edge(wall, e)) - 1;
    }
    if (nearer) index -= 1;
  }
  return index;
}

// Triangles are of one piece where they meet inside the grain.
bool meet_within(const Wall<3>& wall, std::uint32_t f, std::uint32_t g, const Vector<3>& x, double r) {
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t e = wall.facet_edge[3 * f + k];
    for (std::size_t m = 0; m < 3; ++m) {
      if (wall.facet[3 * f + k] == wall.facet[3 * g + m] &&
          norm(x - node_of(wall, wall.facet[3 * f + k])) < r)
        return true;
      if (e != wall.facet_edge[3 * g + m]) continue;
      const Vector<3> a = node_of(wall, wall.edge[2 * e]), b = node_of(wall, wall.edge[2 * e + 1]);
      const double fraction = std::clamp(fraction_along(wall, e, x), 0.0, 1.0);
      if (norm(x - a - fraction * (b - a)) < r) return true;
    }
  }
  return false;
}

void label_pieces(const Wall<3>& wall, std::span<const std::uint32_t> near, const Vector<3>& x, double r,
                  std::vector<std::uint32_t>& piece) {
  piece.assign(near.size(), kNoElement);
  for (std::size_t a = 0; a < near.size(); ++a) {
    if (norm(x - nearest_on_facet(wall, near[a], x)) >= r) continue;
    piece[a] = near[a];
    for (std::size_t b = 0; b < a; ++b)
      if (piece[b] != kNoElement && piece[b] != piece[a] && meet_within(wall, near[a], near[b], x, r))
        merge_pieces(piece, a, b);
  }
}

}  // namespace

const CriticalPoints<3>& critical_points(const Wall<3>& wall, std::span<const std::uint32_t> near,
                                         const Vector<3>& x, double r) {
  static thread_local CriticalPoints<3> found;
  found.points.clear();
  label_pieces(wall, near, x, r, found.piece);
  for (std::size_t n = 0; n < near.size(); ++n) {
    if (found.piece[n] == kNoElement) continue;
    const std::uint32_t f = near[n];
    CriticalPoint<3> point{.element = f, .piece = found.piece[n]};
    const auto note = [&](const Vector<3>& at, double index) {
      const Vector<3> apart = at - x;
      const double distance = norm(apart);
      if (distance >= r || distance == 0 || index == 0) return;
      point.index = index;
      point.overlap = r - distance;
      point.normal = (1 / distance) * apart;
      point.velocity = wall.velocity_at(at);
      found.points.push_back(point);
    };
    if (over(wall, f, 0, x) && over(wall, f, 1, x) && over(wall, f, 2, x)) {
      const Vector<3> normal = normal_of(wall, f);
      note(x - dot(x - node_of(wall, wall.facet[3 * f]), normal) * normal, 1);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      // Edges and nodes are counted with their first triangle.
      const std::uint32_t e = wall.facet_edge[3 * f + k], v = wall.facet[3 * f + k];
      if (wall.edge_facet[wall.edge_start[e]] == f) {
        const double fraction = fraction_along(wall, e, x);
        const Vector<3> a = node_of(wall, wall.edge[2 * e]), b = node_of(wall, wall.edge[2 * e + 1]);
        if (fraction >= 0 && fraction <= 1) note(a + fraction * (b - a), index_of_edge(wall, e, x));
      }
      if (wall.node_facet[wall.node_start[v]] == f) note(node_of(wall, v), index_of_node(wall, v, x));
    }
  }
  return found;
}

}  // namespace estuary::grains
