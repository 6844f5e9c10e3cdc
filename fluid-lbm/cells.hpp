// Which nodes are fluid: a byte per node for the rules at boundaries, runs per row for the kernels.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "grid.hpp"

namespace estuary::fluid {

/// Nodes begin <= x < end of one row.
struct Span {
  int begin = 0;
  int end = 0;
  friend bool operator==(const Span&, const Span&) = default;
};

/// Reasons why a node is not fluid; several may hold.
enum : std::uint8_t {
  cell_fluid = 0,
  cell_outside = 1,    // beyond a side of the grid
  cell_obstacle = 2,   // inside a fixed obstacle of the scene
  cell_wet_solid = 4,  // inside the solid that brings the wet surface
  cell_body = 8        // inside a disc or sphere
};

struct Node {
  int x = 0;
  int y = 0;
  int z = 0;
  friend bool operator==(const Node&, const Node&) = default;
};

class Cells {
public:
  /// All nodes fluid, nodes beyond sides that are not periodic outside.
  explicit Cells(const Grid& grid);

  /// x from -1 to nx, y from -1 to ny (z from -1 to nz in three dimensions); a ghost beyond a periodic side
  /// tells about its image.
  [[nodiscard]] std::uint8_t state(int x, int y, int z = 0) const { return states_[place(x, y, z)]; }
  [[nodiscard]] bool fluid(int x, int y, int z = 0) const { return states_[place(x, y, z)] == cell_fluid; }
  /// In two dimensions: whether all eight nodes around are fluid, too.
  [[nodiscard]] bool surrounded_by_fluid(int x, int y) const {
    const std::uint8_t* const below = &states_[place(x - 1, y - 1, 0)];
    const std::uint8_t* const beside = below + grid_.nx + 2;
    const std::uint8_t* const above = beside + grid_.nx + 2;
    return (below[0] | below[1] | below[2] | beside[0] | beside[2] | above[0] | above[1] | above[2]) ==
           cell_fluid;
  }
  /// Runs of fluid nodes of row y + ny z.
  [[nodiscard]] const std::vector<Span>& row(int row) const { return rows_[static_cast<std::size_t>(row)]; }
  [[nodiscard]] const std::vector<std::vector<Span>>& rows() const { return rows_; }
  [[nodiscard]] std::size_t fluid_count() const;
  /// Grows whenever runs change; 1 at first.
  [[nodiscard]] std::uint64_t changes() const { return changes_; }
  [[nodiscard]] const Grid& grid() const { return grid_; }

  /// Makes `solid` (disjoint, ascending, inside the row) the nodes of row y + ny z that are non-fluid for
  /// `reason`. Nodes that become fluid by this are appended to `uncovered`, the number of fluid nodes that
  /// ceased to be is returned.
  std::size_t set_solid(int row, std::uint8_t reason, const std::vector<Span>& solid,
                        std::vector<Node>& uncovered);

private:
  [[nodiscard]] std::size_t place(int x, int y, int z) const {
    const int layer = grid_.nz > 0 ? z + 1 : 0;
    return (static_cast<std::size_t>(layer) * static_cast<std::size_t>(grid_.ny + 2) +
            static_cast<std::size_t>(y + 1)) *
               static_cast<std::size_t>(grid_.nx + 2) +
           static_cast<std::size_t>(x + 1);
  }
  void set(int x, int y, int z, std::uint8_t state);
  void rebuild_row(int row);

  Grid grid_;
  std::vector<std::uint8_t> states_;
  std::vector<std::vector<Span>> rows_;
  std::uint64_t changes_ = 1;
  // What set_solid was told last, per row, for obstacles, the wet solid and bodies.
  std::array<std::vector<std::vector<Span>>, 3> solid_;
};

}  // namespace estuary::fluid
