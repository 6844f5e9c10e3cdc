// Where the lattice nodes lie.
#pragma once

#include <cmath>

namespace estuary::fluid {

/// nx x ny nodes, `spacing` apart. Inside the solver lengths are counted in spacings from node (0, 0),
/// "lattice coordinates", so that node (i, j) stands at (i, j).
struct Grid {
  int nx = 0;
  int ny = 0;
  double spacing = 1;  // [m]
  double x0 = 0;       // position of node (0, 0) [m]
  double y0 = 0;
  bool periodic_x = false;
  bool periodic_y = false;

  [[nodiscard]] double x(double i) const { return x0 + i * spacing; }
  [[nodiscard]] double y(double j) const { return y0 + j * spacing; }
  [[nodiscard]] double to_lattice_x(double position) const { return (position - x0) / spacing; }
  [[nodiscard]] double to_lattice_y(double position) const { return (position - y0) / spacing; }

  /// Number of the column (row) that `i` means: the periodic image inside the grid, or `i` itself.
  [[nodiscard]] int wrap_x(int i) const { return periodic_x ? (i < 0 ? i + nx : (i >= nx ? i - nx : i)) : i; }
  [[nodiscard]] int wrap_y(int j) const { return periodic_y ? (j < 0 ? j + ny : (j >= ny ? j - ny : j)) : j; }
  [[nodiscard]] bool inside(int i, int j) const { return i >= 0 && i < nx && j >= 0 && j < ny; }
};

}  // namespace estuary::fluid
