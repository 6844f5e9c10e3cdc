// Counts the nodes of one side of the grid.
#pragma once

#include <array>
#include <cstddef>

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

}  // namespace estuary::fluid
