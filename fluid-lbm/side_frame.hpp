// Counts the nodes of one side of the grid.
#pragma once

#include <array>
#include <cstddef>

#include "populations.hpp"

namespace estuary::fluid {

/// Axes u, v of a side and the number k = u + n_u v of each of its nodes; v has one node in two dimensions.
struct SideFrame {
  SideFrame(int name, const std::array<int, 3>& node_counts)
      : axis(name / 2),
        outward(name % 2 == 0 ? -1 : 1),
        u(axis == 0 ? 1 : 0),
        v(axis == 2 ? 1 : 2),
        counts(node_counts) {}

  int axis;     // of the normal
  int outward;  // its sign
  int u;
  int v;
  std::array<int, 3> counts;

  [[nodiscard]] int along_u() const { return counts[static_cast<std::size_t>(u)]; }
  [[nodiscard]] int along_v() const { return counts[static_cast<std::size_t>(v)]; }
  [[nodiscard]] int size() const { return along_u() * along_v(); }
  [[nodiscard]] std::array<int, 3> node(int k) const {
    std::array<int, 3> at{};
    at[static_cast<std::size_t>(v)] = row(k);
    at[static_cast<std::size_t>(u)] = k - row(k) * along_u();
    at[static_cast<std::size_t>(axis)] = outward < 0 ? 0 : counts[static_cast<std::size_t>(axis)] - 1;
    return at;
  }
  /// What `node` was given.
  [[nodiscard]] int number(const std::array<int, 3>& at) const {
    return at[static_cast<std::size_t>(u)] + along_u() * at[static_cast<std::size_t>(v)];
  }
  [[nodiscard]] std::array<int, 3> inner(std::array<int, 3> at) const {
    at[static_cast<std::size_t>(axis)] -= outward;
    return at;
  }
  /// Whether the node also lies on another side.
  [[nodiscard]] bool on_rim(int k, int dimension) const {
    const int b = row(k);
    const int a = k - b * along_u();
    return a == 0 || a == along_u() - 1 || (dimension == 3 && (b == 0 || b == along_v() - 1));
  }
  /// Along v. Walls are passed in every step, so the plane is spared the division.
  [[nodiscard]] int row(int k) const { return along_v() == 1 ? 0 : k / along_u(); }
  /// Points of a wall, half spacings apart: how many along each axis, and which one direction c from node k
  /// hits.
  [[nodiscard]] int points_u() const { return 2 * along_u() + 1; }
  [[nodiscard]] int points_v(int dimension) const { return dimension == 3 ? 2 * along_v() + 1 : 1; }
  [[nodiscard]] std::size_t wall_point(int k, const std::array<int, 3>& c) const {
    const int a = 2 * (k - row(k) * along_u()) + 1 + c[static_cast<std::size_t>(u)];
    if (counts[2] == 1 && v == 2) return static_cast<std::size_t>(a);
    const int b = 2 * row(k) + 1 + c[static_cast<std::size_t>(v)];
    return static_cast<std::size_t>(b) * static_cast<std::size_t>(points_u()) + static_cast<std::size_t>(a);
  }
};

/// The layers of the outermost axis that this process holds.
struct OwnLayers {
  explicit OwnLayers(const Populations& p)
      : axis(p.nz() > 0 ? 2 : 1),
        first(p.nz() > 0 ? p.first_row() / p.ny() : p.first_row()),
        past(p.nz() > 0 ? p.past_row() / p.ny() : p.past_row()),
        part(p.past_row() - p.first_row() < p.rows()) {}
  int axis;
  int first;
  int past;
  bool part;  // not all of them
};

/// Of a side's nodes those that this process holds: first_u <= u < past_u, and the same of v.
struct OwnNodes {
  OwnNodes(const Populations& p, const SideFrame& frame)
      : past_u(frame.along_u()), past_v(frame.along_v()), line(frame.along_u()) {
    const OwnLayers own(p);
    if (!own.part) return;
    if (own.axis == frame.axis) {
      const int layer = frame.outward < 0 ? 0 : frame.counts[static_cast<std::size_t>(own.axis)] - 1;
      if (layer < own.first || layer >= own.past) past_u = 0;
    } else if (own.axis == frame.u) {
      first_u = own.first;
      past_u = own.past;
    } else {
      first_v = own.first;
      past_v = own.past;
    }
  }
  int first_u = 0;
  int past_u;
  int first_v = 0;
  int past_v;
  int line;
  [[nodiscard]] bool empty() const { return first_u >= past_u || first_v >= past_v; }
  /// Their numbers (SideFrame) follow each other: a line along u is whole, or the only one.
  [[nodiscard]] int first() const { return first_u + first_v * line; }
  [[nodiscard]] int past() const { return empty() ? first() : past_u + (past_v - 1) * line; }
};

}  // namespace estuary::fluid
