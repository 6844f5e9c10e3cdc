// Everything that changes while grains move: copied to go back to the start of a window, written to restart.
//
// Structure of arrays; vectors are interleaved (x0 y0 x1 y1 ...). Grains are kept in the order of the cells
// they lie in, so that neighbours are near in memory; `identity` says which grain of the scene each one is.
#pragma once

#include <cstdint>
#include <vector>

#include "contact_law.hpp"

namespace estuary::grains {

/// Grains per block of work. Blocks, not threads, decide the order of every sum, so that any number of
/// threads gives the same bits.
inline constexpr std::size_t kBlockSize = 1024;

/// From how many blocks on threads share the work: below, waiting for each other costs more than it brings.
inline constexpr std::size_t kParallelBlocks = 4;

inline std::size_t block_count(std::size_t grains) {
  return (grains + kBlockSize - 1) / kBlockSize;
}
inline std::size_t block_begin(std::size_t block) {
  return block * kBlockSize;
}
inline std::size_t block_end(std::size_t block, std::size_t grains) {
  return std::min(grains, (block + 1) * kBlockSize);
}

/// Pieces of one polyline or mesh that a grain can touch at a time with a memory of each.
inline constexpr std::size_t kWallContacts = 4;
inline constexpr std::uint32_t kNoElement = 0xffffffff;

/// A grain within reach of a wall: one entry for a plane, kWallContacts for a polyline or mesh, one per piece
/// touched.
struct WallContact {
  std::uint32_t grain = 0;
  std::uint32_t wall = 0;
  std::uint32_t element = kNoElement;          // a facet of the piece touched; see walls.hpp
  std::uint32_t near_begin = 0, near_end = 0;  // of State::wall_facet
};

template <int D>
struct State {
  // D per grain.
  std::vector<double> position, velocity, force, external_force;
  // One per grain in the plane, three in space.
  std::vector<double> spin, torque, external_torque;
  // One per grain. Mass and inertia are per metre of depth in the plane.
  std::vector<double> radius;        // at which contacts act [m]
  std::vector<double> inverse_mass;  // 0 for a grain that moves as prescribed
  std::vector<double> inverse_inertia;
  std::vector<std::uint32_t> identity;
  std::vector<double> wrapped;  // D per grain: what periodic sides took off the position since the start [m]

  // Pairs that may touch before the list is next rebuilt, row by row; partner > row, ascending.
  std::vector<double> reference_position;  // where the grains were at the last rebuild
  std::vector<std::uint32_t> row_start, partner;
  std::vector<std::uint8_t> image;        // which periodic image of the partner
  std::vector<double> root_mass;          // sqrt(m*)
  std::vector<double> history;            // history_size per pair
  std::vector<WallContact> wall_contact;  // ordered by grain
  std::vector<std::uint32_t> wall_facet;  // of polylines and meshes, within reach of a grain
  std::vector<double> wall_history;       // history_size per wall contact
  std::vector<double> wall_travel;        // per wall: displacement since the start, D each [m]

  double wall_moved = 0;  // largest way of a wall since the last rebuild [m]

  double time = 0;
  EnergyLedger ledger;
  double external_work = 0;  // of forces given from outside (the fluid) [J]
  double bond_loss = 0;      // energy of broken bonds [J]

  [[nodiscard]] std::size_t size() const { return radius.size(); }
};

}  // namespace estuary::grains
