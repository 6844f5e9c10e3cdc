// Contact of a grain with a polyline: which pieces it touches, where, and how deep.
#include <algorithm>
#include <cmath>

#include "walls.hpp"

namespace estuary::grains {
namespace {

// A foot on a segment, or a node: where the distance to the grain is smallest (sign 1) or largest (-1).
struct CriticalPoint {
  double sign = 1, overlap = 0;
  Vector<2> normal{}, velocity{};
  std::uint32_t element = 0, piece = 0;
  std::uint32_t first = 0, second = 0;  // nodes, and the share of the second
  double share = 0;
};

// Kept from call to call: no allocation once it has grown.
struct Scratch {
  std::vector<CriticalPoint> points;
  std::vector<std::uint32_t> piece;  // of each near segment; kNoElement beyond the grain's radius
};

struct Projection {
  double fraction = 0;  // along the segment, of its length
  double height = 0;    // to the left of it
  Vector<2> inward{};
};

Vector<2> node_of(const Wall<2>& wall, std::uint32_t k) {
  return load<2>(wall.node.data(), k);
}

Projection project(const Wall<2>& wall, std::uint32_t s, const Vector<2>& x) {
  const Vector<2> a = node_of(wall, wall.segment[2 * s]), t = node_of(wall, wall.segment[2 * s + 1]) - a;
  const double length = norm(t);
  const Vector<2> inward{-t[1] / length, t[0] / length};
  return {dot(x - a, t) / (length * length), dot(x - a, inward), inward};
}

// Seen from x, the segment goes on from its node `k`: x does not project beyond that end, nor lies behind.
bool goes_on(const Wall<2>& wall, std::uint32_t s, std::uint32_t k, const Vector<2>& x) {
  const Projection p = project(wall, s, x);
  return p.height >= 0 && (wall.segment[2 * s] == k ? p.fraction >= 0 : p.fraction <= 1);
}

Vector<2> velocity_at(const Wall<2>& wall, const CriticalPoint& point) {
  return wall.velocity + (1 - point.share) * load<2>(wall.node_velocity.data(), point.first) +
         point.share * load<2>(wall.node_velocity.data(), point.second);
}

// Labels the near segments by the pieces they make: segments are of one piece where they meet inside the
// grain.
void label_pieces(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x, double r,
                  std::vector<std::uint32_t>& piece) {
  piece.assign(near.size(), kNoElement);
  for (std::size_t a = 0; a < near.size(); ++a) {
    const Projection p = project(wall, near[a], x);
    const Vector<2> first = node_of(wall, wall.segment[2 * near[a]]);
    const Vector<2> way = node_of(wall, wall.segment[2 * near[a] + 1]) - first;
    if (norm(x - first - std::clamp(p.fraction, 0.0, 1.0) * way) >= r) continue;
    piece[a] = near[a];
    for (std::size_t b = 0; b < a; ++b) {
      if (piece[b] == kNoElement || piece[b] == piece[a]) continue;
      for (const std::uint32_t k : {wall.segment[2 * near[a]], wall.segment[2 * near[a] + 1]}) {
        if (k != wall.segment[2 * near[b]] && k != wall.segment[2 * near[b] + 1]) continue;
        if (norm(x - node_of(wall, k)) >= r) continue;
        const std::uint32_t from = std::max(piece[a], piece[b]), to = std::min(piece[a], piece[b]);
        std::replace(piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(a) + 1, from, to);
      }
    }
  }
}

// A grain whose centre has gone through the line: pushed back across what is nearest. False when it has not.
bool find_breach(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x, double r,
                 Scratch& scratch) {
  double nearest = r;
  CriticalPoint breach;
  bool behind = false;
  for (std::size_t n = 0; n < near.size(); ++n) {
    const std::uint32_t s = near[n];
    const Projection p = project(wall, s, x);
    const double share = std::clamp(p.fraction, 0.0, 1.0);
    const std::uint32_t first = wall.segment[2 * s], second = wall.segment[2 * s + 1];
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
      mean = mean + project(wall, wall.node_segment[m], x).inward;
    behind = wall.node_start[k + 1] - wall.node_start[k] > 1 && dot(apart, mean) < 0;
    if (distance > 0) breach.normal = (1 / distance) * apart;
  }
  if (!behind) return false;
  breach.velocity = velocity_at(wall, breach);
  scratch.points.assign(1, breach);
  return true;
}

const Scratch& critical_points(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x,
                               double r) {
  static thread_local Scratch scratch;
  scratch.points.clear();
  label_pieces(wall, near, x, r, scratch.piece);
  if (find_breach(wall, near, x, r, scratch)) return scratch;
  for (std::size_t n = 0; n < near.size(); ++n) {
    if (scratch.piece[n] == kNoElement) continue;
    const std::uint32_t s = near[n];
    const Projection p = project(wall, s, x);
    CriticalPoint point{.element = s,
                        .piece = scratch.piece[n],
                        .first = wall.segment[2 * s],
                        .second = wall.segment[2 * s + 1]};
    if (p.height >= 0 && p.height < r && p.fraction >= 0 && p.fraction <= 1) {
      point.overlap = r - p.height;
      point.normal = -1.0 * p.inward;
      point.share = p.fraction;
      point.velocity = velocity_at(wall, point);
      scratch.points.push_back(point);
    }
    for (const std::uint32_t k : {wall.segment[2 * s], wall.segment[2 * s + 1]}) {
      if (wall.node_segment[wall.node_start[k]] != s) continue;  // counted with its first segment
      const Vector<2> apart = node_of(wall, k) - x;
      const double distance = norm(apart);
      if (distance >= r || distance == 0) continue;
      point.sign = 1;
      for (std::uint32_t m = wall.node_start[k]; m < wall.node_start[k + 1]; ++m)
        if (goes_on(wall, wall.node_segment[m], k, x)) point.sign -= 1;
      if (point.sign == 0) continue;
      point.overlap = r - distance;
      point.normal = (1 / distance) * apart;
      point.first = point.second = k;
      point.share = 0;
      point.velocity = velocity_at(wall, point);
      scratch.points.push_back(point);
    }
  }
  return scratch;
}

}  // namespace

PolylineTouches find_touches(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x,
                             double r, const std::array<std::uint32_t, kWallContacts>& former) {
  PolylineTouches result;
  result.now.fill(kWallContacts);
  const Scratch& scratch = critical_points(wall, near, x, r);
  if (scratch.points.empty()) return result;
  const auto piece_of = [&](std::uint32_t element) {
    for (std::size_t n = 0; n < near.size(); ++n)
      if (near[n] == element) return scratch.piece[n];
    return kNoElement;
  };
  // One pass per piece: `done` is the label of the last one; labels are segments and ascend.
  std::array<bool, kWallContacts> taken{};
  std::array<std::uint32_t, kWallContacts> waiting{};
  std::size_t waits = 0;
  std::array<std::uint32_t, kWallContacts> piece_in;
  piece_in.fill(kNoElement);
  std::uint32_t label = 0;
  for (bool more = true; more;) {
    std::uint32_t next = kNoElement;
    for (const CriticalPoint& point : scratch.points)
      if (point.piece >= label) next = std::min(next, point.piece);
    more = next != kNoElement;
    if (!more) break;
    label = next + 1;
    std::size_t home = kWallContacts;
    for (std::size_t k = 0; k < kWallContacts; ++k) {
      if (former[k] == kNoElement || piece_of(former[k]) != next) continue;
      if (home == kWallContacts) home = k;
      result.now[k] = home;
    }
    if (home != kWallContacts) {
      piece_in[home] = next;
      taken[home] = true;
    } else if (waits < kWallContacts) {
      waiting[waits++] = next;
    }
  }
  for (std::size_t w = 0; w < waits; ++w)
    for (std::size_t k = 0; k < kWallContacts; ++k) {
      if (taken[k]) continue;
      taken[k] = true;
      piece_in[k] = waiting[w];
      break;
    }
  for (std::size_t k = 0; k < kWallContacts; ++k) {
    if (!taken[k]) continue;
    WallTouch<2>& touch = result.slot[k];
    Vector<2> push{};
    double weight = 0, deepest = 0;
    for (const CriticalPoint& point : scratch.points) {
      if (point.piece != piece_in[k]) continue;
      const double part = point.sign * point.overlap;
      push = push + part * point.normal;
      touch.velocity = touch.velocity + part * point.velocity;
      weight += part;
      if (part <= deepest) continue;
      deepest = part;
      touch.element = point.element;
    }
    touch.overlap = norm(push);
    // Pushed from opposite sides with the same strength: no direction, no force.
    if (!(touch.overlap > 0) || !(weight > 0)) {
      touch = {};
      continue;
    }
    touch.normal = (1 / touch.overlap) * push;
    touch.velocity = (1 / weight) * touch.velocity;
  }
  return result;
}

void share_between_nodes(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x,
                         double r, std::uint32_t element, const Vector<2>& force,
                         std::vector<double>& node_force) {
  const Scratch& scratch = critical_points(wall, near, x, r);
  std::uint32_t piece = kNoElement;
  for (const CriticalPoint& point : scratch.points)
    if (point.element == element) piece = point.piece;
  double weight = 0;
  for (const CriticalPoint& point : scratch.points)
    if (point.piece == piece) weight += point.sign * point.overlap;
  for (const CriticalPoint& point : scratch.points) {
    if (point.piece != piece) continue;
    const double part = point.sign * point.overlap / weight;
    add(node_force.data(), point.first, (part * (1 - point.share)) * force);
    add(node_force.data(), point.second, (part * point.share) * force);
  }
}

}  // namespace estuary::grains
