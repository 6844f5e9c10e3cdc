// Neighbour lists of particles that move through each other: built by cells with a margin, and used until
// some particle has moved by half of the margin relative to the mean motion of all (Verlet 1967).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace estuary::solid {

class MovingNeighbours {
public:
  MovingNeighbours(double reach, double margin) : reach_(reach), margin_(margin) {}

  /// Builds the lists again when the positions (2 numbers per particle) ask for it; true when it did.
  bool update(std::span<const double> position);
  /// The lists must hold all neighbours within `reach`.
  void need_reach(double reach);

  /// Neighbours of i within the reach, and a few beyond: neighbour[first[i]] .. [first[i + 1] - 1],
  /// ascending.
  [[nodiscard]] const std::vector<std::uint32_t>& first() const { return first_; }
  [[nodiscard]] const std::vector<std::uint32_t>& neighbour() const { return neighbour_; }
  [[nodiscard]] std::uint64_t builds() const { return builds_; }

private:
  [[nodiscard]] bool stale(std::span<const double> position) const;
  void build(std::span<const double> position);

  double reach_, margin_;
  std::vector<std::uint32_t> first_, neighbour_;
  std::vector<double> built_at_;
  std::vector<std::uint32_t> cell_first_, cell_particle_, cell_of_;
  std::uint64_t builds_ = 0;
};

}  // namespace estuary::solid
