// Critical points of a polyline: feet on segments, and nodes that stick out or lie between two feet.
#include <algorithm>
#include <cmath>

#include "critical_points.hpp"

namespace estuary::grains {
namespace {

struct Projection {
  double fraction = 0;  // along the segment, of its length
  double height = 0;    // to the left of it
  Vector<2> inward{};
};

Vector<2> node_of(const Wall<2>& wall, std::uint32_t k) {
  return load<2>(wall.node.data(), k);
}

Projection project(const Wall<2>& wall, std::uint32_t s, const Vector<2>& x) {
  const Vector<2> a = node_of(wall, wall.facet[2 * s]), t = node_of(wall, wall.facet[2 * s + 1]) - a;
  const double length = norm(t);
  const Vector<2> inward{-t[1] / length, t[0] / length};
  return {dot(x - a, t) / (length * length), dot(x - a, inward), inward};
}

// Seen from x, the segment goes on from its node `k`: x does not project beyond that end, nor lies behind.
bool goes_on(const Wall<2>& wall, std::uint32_t s, std::uint32_t k, const Vector<2>& x) {
  const Projection p = project(wall, s, x);
  return p.height >= 0 && (wall.facet[2 * s] == k ? p.fraction >= 0 : p.fraction <= 1);
}

Vector<2> velocity_at(const Wall<2>& wall, const CriticalPoint<2>& point, const Vector<2>& at) {
  return wall.velocity_at(at) + (1 - point.share) * load<2>(wall.node_velocity.data(), point.first) +
         point.share * load<2>(wall.node_velocity.data(), point.second);
}

// Labels the near segments by the pieces they make: segments are of one piece where they meet inside the
// grain.
void label_pieces(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x, double r,
                  std::vector<std::uint32_t>& piece) {
  piece.assign(near.size(), kNoElement);
  for (std::size_t a = 0; a < near.size(); ++a) {
    const Projection p = project(wall, near[a], x);
    const Vector<2> first = node_of(wall, wall.facet[2 * near[a]]);
    const Vector<2> way = node_of(wall, wall.facet[2 * near[a] + 1]) - first;
    if (norm(x - first - std::clamp(p.fraction, 0.0, 1.0) * way) >= r) continue;
    piece[a] = near[a];
    for (std::size_t b = 0; b < a; ++b) {
      if (piece[b] == kNoElement || piece[b] == piece[a]) continue;
      for (const std::uint32_t k : {wall.facet[2 * near[a]], wall.facet[2 * near[a] + 1]}) {
        if (k != wall.facet[2 * near[b]] && k != wall.facet[2 * near[b] + 1]) continue;
        if (norm(x - node_of(wall, k)) >= r) continue;
        merge_pieces(piece, a, b);
      }
    }
  }
}

// A grain whose centre has gone through the line: pushed back across what is nearest. False when it has not.
bool find_breach(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x, double r,
                 CriticalPoints<2>& scratch) {
  double nearest = r;
  CriticalPoint<2> breach;
  bool behind = false;
  for (std::size_t n = 0; n < near.size(); ++n) {
    const std::uint32_t s = near[n];
    const Projection p = project(wall, s, x);
    const double share = std::clamp(p.fraction, 0.0, 1.0);
    const std::uint32_t first = wall.facet[2 * s], second = wall.facet[2 * s + 1];
    const Vector<2> apart = x - node_of(wall, first) - share * (node_of(wall, second) - node_of(wall, first));
    const double distance = norm(apart);
    if (distance >= nearest) continue;
    nearest = distance;
    behind = p.height < 0;
    breach = {1, r + distance, -1.0 * p.inward, {}, s, scratch.piece[n], first, second, share};
    if (share == p.fraction) continue;
    // At a node: behind it when behind the mean of the two segments; beyond the end of a line is no side.
    const std::uint32_t k = share == 0 ? first : second;
    Vector<2> mean{};
    for (std::uint32_t m = wall.node_start[k]; m < wall.node_start[k + 1]; ++m)
      mean = mean + project(wall, wall.node_facet[m], x).inward;
    behind = wall.node_start[k + 1] - wall.node_start[k] > 1 && dot(apart, mean) < 0;
    if (distance > 0) breach.normal = (1 / distance) * apart;
  }
  if (!behind) return false;
  breach.velocity = velocity_at(wall, breach, x - (breach.overlap - r) * breach.normal);
  scratch.points.assign(1, breach);
  return true;
}

}  // namespace

const CriticalPoints<2>& critical_points(const Wall<2>& wall, std::span<const std::uint32_t> near,
                                         const Vector<2>& x, double r) {
  static thread_local CriticalPoints<2> scratch;
  scratch.points.clear();
  label_pieces(wall, near, x, r, scratch.piece);
  if (find_breach(wall, near, x, r, scratch)) return scratch;
  for (std::size_t n = 0; n < near.size(); ++n) {
    if (scratch.piece[n] == kNoElement) continue;
    const std::uint32_t s = near[n];
    const Projection p = project(wall, s, x);
    CriticalPoint<2> point{
        .element = s, .piece = scratch.piece[n], .first = wall.facet[2 * s], .second = wall.facet[2 * s + 1]};
    if (p.height >= 0 && p.height < r && p.fraction >= 0 && p.fraction <= 1) {
      point.overlap = r - p.height;
      point.normal = -1.0 * p.inward;
      point.share = p.fraction;
      point.velocity = velocity_at(wall, point, x + p.height * point.normal);
      scratch.points.push_back(point);
    }
    for (const std::uint32_t k : {wall.facet[2 * s], wall.facet[2 * s + 1]}) {
      if (wall.node_facet[wall.node_start[k]] != s) continue;  // counted with its first segment
      const Vector<2> apart = node_of(wall, k) - x;
      const double distance = norm(apart);
      if (distance >= r || distance == 0) continue;
      point.index = 1;
      for (std::uint32_t m = wall.node_start[k]; m < wall.node_start[k + 1]; ++m)
        if (goes_on(wall, wall.node_facet[m], k, x)) point.index -= 1;
      if (point.index == 0) continue;
      point.overlap = r - distance;
      point.normal = (1 / distance) * apart;
      point.first = point.second = k;
      point.share = 0;
      point.velocity = velocity_at(wall, point, node_of(wall, k));
      scratch.points.push_back(point);
    }
  }
  return scratch;
}

void share_between_nodes(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x,
                         double r, std::uint32_t element, const Vector<2>& force,
                         std::vector<double>& node_force) {
  const CriticalPoints<2>& scratch = critical_points(wall, near, x, r);
  std::uint32_t piece = kNoElement;
  for (const CriticalPoint<2>& point : scratch.points)
    if (point.element == element) piece = point.piece;
  double weight = 0;
  for (const CriticalPoint<2>& point : scratch.points)
    if (point.piece == piece) weight += point.index * point.overlap;
  for (const CriticalPoint<2>& point : scratch.points) {
    if (point.piece != piece) continue;
    const double part = point.index * point.overlap / weight;
    add(node_force.data(), point.first, (part * (1 - point.share)) * force);
    add(node_force.data(), point.second, (part * point.share) * force);
  }
}

}  // namespace estuary::grains
