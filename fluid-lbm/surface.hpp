// A polyline that separates fluid from solid: the wet surface of a moving solid, or the outlines of fixed
// obstacles. The fluid lies to the LEFT of a segment walked from its first to its second node.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cells.hpp"
#include "grid.hpp"

namespace estuary::fluid {

/// How far inside the wet surface a node may lie and still be fluid [spacings].
constexpr double surface_inset = 1e-3;

/// From node a to node b, in lattice coordinates; an image beyond a periodic side has the same node numbers.
struct Segment {
  double ax = 0;
  double ay = 0;
  double bx = 0;
  double by = 0;
  std::uint32_t a = 0;
  std::uint32_t b = 0;
};

class Surface {
public:
  /// `connectivity` holds the two node numbers of each segment, all below `nodes`. A line whose two ends both
  /// lie inside the domain (a bar fixed to an obstacle) is closed by a segment from its last node to its
  /// first.
  Surface(const Grid& grid, std::size_t nodes, std::vector<std::uint32_t> connectivity);

  /// Takes positions [m] and velocities [m/s] of all nodes, two components each. `velocity_scale` is dt/dx.
  void place(std::span<const double> positions, std::span<const double> velocities, double velocity_scale);

  /// The same segments with every node moved by `distance` [spacings] into the solid: what tells fluid from
  /// solid nodes. Nodes on the surface, as an outline of round figures often has, then stay fluid when it
  /// moves by less to either side; each change would be a jump of the load.
  /// Valid until the next call.
  const std::vector<Segment>& inset_segments(double distance);

  [[nodiscard]] std::size_t node_count() const { return nodes_; }
  /// All segments near the grid, images beyond periodic sides and closing segments included.
  [[nodiscard]] const std::vector<Segment>& segments() const { return segments_; }
  /// Whether it is one that closes an open line.
  [[nodiscard]] bool closes_a_line(const Segment& segment) const;
  /// In lattice coordinates and lattice units, two components per node.
  [[nodiscard]] const std::vector<double>& positions() const { return positions_; }
  [[nodiscard]] const std::vector<double>& velocities() const { return velocities_; }
  [[nodiscard]] const std::vector<std::uint32_t>& connectivity() const { return connectivity_; }
  /// Unit normals into the fluid, the mean of the neighbouring segments' weighted with their lengths.
  [[nodiscard]] std::vector<double> node_normals() const;

  struct Nearest {
    double distance_squared = 0;
    double normal_x = 0;  // unit normal of the nearest segment, into the fluid
    double normal_y = 0;
    double velocity_x = 0;  // of the nearest point, lattice units
    double velocity_y = 0;
    std::uint32_t node = 0;  // one of the nearest segment
  };
  /// The surface's point nearest to (x, y) in lattice coordinates.
  [[nodiscard]] Nearest nearest(double x, double y) const;

private:
  void find_normals(std::vector<double>& normals) const;
  void add_segment(std::uint32_t a, std::uint32_t b);
  [[nodiscard]] bool lies_inside(std::uint32_t node) const;

  Grid grid_;
  std::size_t nodes_;
  std::vector<std::uint32_t> connectivity_;
  std::vector<std::uint32_t> open_ends_;  // last and first node of each line that is not closed
  std::vector<double> positions_;
  std::vector<double> velocities_;
  std::vector<Segment> segments_;
  std::vector<Segment> inset_;
  std::vector<double> normals_;
};

/// Finds the nodes inside the solid, row by row, from the signed crossings of the surface with the rows: a
/// crossing knows whether a walker in +x enters or leaves the solid, so that closed outlines, outlines that
/// end on a wall, lines from one periodic side to the other and holes are all the same case. Costs as many
/// operations as the surface has crossings.
class SolidRows {
public:
  explicit SolidRows(const Grid& grid);
  /// Element y holds the runs of nodes of row y that are solid; a node exactly on a crossing is. Valid until
  /// the next call.
  const std::vector<std::vector<Span>>& classify(const std::vector<Segment>& segments);

private:
  struct Crossing {
    double at = 0;
    int change = 0;  // +1 enters the solid, -1 leaves it
  };
  static int depth_before(const std::vector<Crossing>& crossings);
  static void sort(std::vector<Crossing>& crossings);
  void find_crossings(const std::vector<Segment>& segments);
  void set_first_states();

  Grid grid_;
  std::vector<std::vector<Crossing>> rows_;
  std::vector<Crossing> first_column_;
  std::vector<std::uint8_t> first_solid_;  // whether node (0, y) is solid
  std::vector<std::vector<Span>> solid_;
};

}  // namespace estuary::fluid
