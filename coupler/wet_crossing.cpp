#include "wet_crossing.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numeric>
#include <vector>

namespace estuary::coupler {
namespace {

// By how much of the longer facet's length each has to reach beyond the other.
constexpr double touching_share = 1e-9;
// Facets shorter than this part of their distance from the origin have no direction left.
constexpr double shortest_share = 1e-12;

struct Place {
  double x = 0;
  double y = 0;
};

struct MovedFacet {
  Place a;
  Place b;
  Place low;  // of its box
  Place high;
  std::uint32_t node_a = 0;
  std::uint32_t node_b = 0;
  double length = 0;
  int level = 0;  // cells of 2^level are longer than it
};

double turn_to(const MovedFacet& f, const Place& p) {
  return (f.b.x - f.a.x) * (p.y - f.a.y) - (f.b.y - f.a.y) * (p.x - f.a.x);
}

bool lie_apart(const MovedFacet& f, const MovedFacet& g) {
  return f.high.x < g.low.x || g.high.x < f.low.x || f.high.y < g.low.y || g.high.y < f.low.y;
}

// Whether the ends of `g` lie on both sides of the line through `f`, by more than `least`.
bool on_both_sides(const MovedFacet& f, const MovedFacet& g, double least) {
  const double a = turn_to(f, g.a);
  const double b = turn_to(f, g.b);
  return std::min(a, b) < -least * f.length && std::max(a, b) > least * f.length;
}

bool facets_cross(const MovedFacet& f, const MovedFacet& g) {
  if (f.node_a == g.node_a || f.node_a == g.node_b || f.node_b == g.node_a || f.node_b == g.node_b)
    return false;
  if (lie_apart(f, g)) return false;
  const double least = touching_share * std::max(f.length, g.length);
  return on_both_sides(f, g, least) && on_both_sides(g, f, least);
}

WetCrossing crossing_of(const MovedFacet& f, const MovedFacet& g) {
  const double from = turn_to(g, f.a);
  const double along = from / (from - turn_to(g, f.b));
  return {.nodes = {f.node_a, g.node_a},
          .place = {f.a.x + along * (f.b.x - f.a.x), f.a.y + along * (f.b.y - f.a.y)}};
}

std::vector<MovedFacet> moved_facets(const v1::WetSurface& surface, std::span<const double> displacement) {
  const double* const rest = surface.reference_positions().data();
  const std::uint32_t* const ends = surface.connectivity().data();
  const auto at = [&](std::size_t n) {
    return Place{rest[2 * n] + displacement[2 * n], rest[2 * n + 1] + displacement[2 * n + 1]};
  };
  std::vector<MovedFacet> facets;
  const auto count = static_cast<std::size_t>(surface.connectivity_size() / 2);
  facets.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    MovedFacet f;
    f.a = at(ends[2 * k]);
    f.b = at(ends[2 * k + 1]);
    f.low = {std::min(f.a.x, f.b.x), std::min(f.a.y, f.b.y)};
    f.high = {std::max(f.a.x, f.b.x), std::max(f.a.y, f.b.y)};
    f.node_a = ends[2 * k];
    f.node_b = ends[2 * k + 1];
    const double dx = f.b.x - f.a.x;
    const double dy = f.b.y - f.a.y;
    f.length = std::sqrt(dx * dx + dy * dy);
    const double away = std::abs(f.a.x) + std::abs(f.a.y) + std::abs(f.b.x) + std::abs(f.b.y);
    if (!(f.length > shortest_share * away && away < 1e150)) continue;
    f.level = std::ilogb(f.length) + 1;
    facets.push_back(f);
  }
  return facets;
}

// Grids of cells without bounds, one for each level, in one hash table. Facets of cells that fall on the
// same place of the table are compared in vain, no more.
class FacetGrids {
public:
  explicit FacetGrids(const std::vector<MovedFacet>& facets)
      : facets_(facets), first_(std::bit_ceil(4 * facets.size() + 1), -1) {
    entries_.reserve(3 * facets.size());
  }

  // Goes through the cells of a level that a facet's box meets, at most four of its own level, until one
  // holds a facet that it crosses; -1 without. Puts it into them, if `put`.
  std::int32_t crossed_by(std::size_t facet, int level, bool put) {
    const MovedFacet& f = facets_[facet];
    const double per_length = std::ldexp(1.0, -level);
    const auto cell = [&](double at) { return static_cast<std::int64_t>(std::floor(at * per_length)); };
    const std::int64_t left = cell(f.low.x);
    const std::int64_t right = cell(f.high.x);
    const std::int64_t top = cell(f.high.y);
    for (std::int64_t row = cell(f.low.y); row <= top; ++row) {
      for (std::int64_t column = left; column <= right; ++column) {
        std::int32_t& first = first_[place_of(column, row, level)];
        for (std::int32_t e = first; e >= 0; e = entries_[static_cast<std::size_t>(e)].next) {
          const std::int32_t other = entries_[static_cast<std::size_t>(e)].facet;
          if (facets_cross(f, facets_[static_cast<std::size_t>(other)])) return other;
        }
        if (!put) continue;
        entries_.push_back({static_cast<std::int32_t>(facet), first});
        first = static_cast<std::int32_t>(entries_.size() - 1);
      }
    }
    return -1;
  }

private:
  struct Entry {
    std::int32_t facet = 0;
    std::int32_t next = -1;  // of the same place
  };
  [[nodiscard]] std::size_t place_of(std::int64_t column, std::int64_t row, int level) const {
    std::uint64_t h = static_cast<std::uint64_t>(column) * 0x9E3779B97F4A7C15ULL;
    h ^= static_cast<std::uint64_t>(row) * 0xC2B2AE3D27D4EB4FULL + static_cast<std::uint64_t>(level);
    h *= 0xD6E8FEB86659FD93ULL;
    return (h >> 32U) & (first_.size() - 1);
  }

  const std::vector<MovedFacet>& facets_;
  std::vector<std::int32_t> first_;
  std::vector<Entry> entries_;
};

std::vector<int> levels_of(const std::vector<MovedFacet>& facets) {
  std::vector<int> levels;
  for (const MovedFacet& f : facets)
    if (std::find(levels.begin(), levels.end(), f.level) == levels.end()) levels.push_back(f.level);
  std::sort(levels.begin(), levels.end(), std::greater<>());
  return levels;
}

bool has_two_lines(const v1::WetSurface& surface) {
  std::vector<std::uint32_t> line(static_cast<std::size_t>(surface.reference_positions_size() / 2));
  std::iota(line.begin(), line.end(), 0U);
  const auto line_of = [&](std::uint32_t n) {
    while (line[n] != n) n = line[n] = line[line[n]];
    return n;
  };
  const auto& ends = surface.connectivity();
  for (int k = 0; k + 1 < ends.size(); k += 2) line[line_of(ends[k])] = line_of(ends[k + 1]);
  return std::any_of(ends.begin(), ends.end(),
                     [&](std::uint32_t n) { return line_of(n) != line_of(ends[0]); });
}

}  // namespace

bool bodies_can_meet(const v1::WetSurface& surface) {
  if (surface.dimension() != 2 || !has_two_lines(surface)) return false;
  const std::vector<double> rest(static_cast<std::size_t>(surface.reference_positions_size()), 0.0);
  return !find_crossing(surface, rest);
}

std::optional<WetCrossing> find_crossing(const v1::WetSurface& surface,
                                         std::span<const double> displacement) {
  if (surface.dimension() != 2) return std::nullopt;
  const std::vector<MovedFacet> facets = moved_facets(surface, displacement);
  FacetGrids grids(facets);
  // Long ones first: every facet then finds those of its own length and longer ones, in few cells.
  const std::vector<int> levels = levels_of(facets);
  for (std::size_t k = 0; k < levels.size(); ++k) {
    for (std::size_t n = 0; n < facets.size(); ++n) {
      if (facets[n].level != levels[k]) continue;
      for (std::size_t longer = 0; longer <= k; ++longer) {
        const std::int32_t other = grids.crossed_by(n, levels[longer], longer == k);
        if (other >= 0) return crossing_of(facets[n], facets[static_cast<std::size_t>(other)]);
      }
    }
  }
  return std::nullopt;
}

}  // namespace estuary::coupler
