// Where the lattice nodes lie.
#pragma once

#include <cmath>
#include <cstddef>

namespace estuary::fluid {

/// nx x ny (x nz) nodes, `spacing` apart; nz is 0 in two dimensions. Inside the solver lengths are counted in
/// spacings from node (0, 0), "lattice coordinates", so that node (i, j) stands at (i, j).
struct Grid {
  int nx = 0;
  int ny = 0;
  double spacing = 1;  // [m]
  double x0 = 0;       // position of node (0, 0) [m]
  double y0 = 0;
  bool periodic_x = false;
  bool periodic_y = false;
  int nz = 0;
  double z0 = 0;
  bool periodic_z = false;
  // Several processes may share a grid, each with a slab of layers: rows in the plane, planes in space.
  int ranks = 1;
  int rank = 0;

  [[nodiscard]] int dimension() const { return nz > 0 ? 3 : 2; }
  [[nodiscard]] int layers() const { return nz > 0 ? nz : 1; }
  /// Rows of nodes along x: row y + ny z.
  [[nodiscard]] int rows() const { return ny * layers(); }
  [[nodiscard]] std::size_t size() const {
    return static_cast<std::size_t>(nx) * static_cast<std::size_t>(rows());
  }
  /// Nodes along the outermost axis, and where along it a node lies.
  [[nodiscard]] int slab_layers() const { return nz > 0 ? nz : ny; }
  [[nodiscard]] int slab_layer(int y, int z) const { return nz > 0 ? z : y; }
  /// Layers begin <= s < end of a rank, all when there is one; the first ranks have one more where they do
  /// not come out even.
  [[nodiscard]] int first_layer_of(int r) const {
    return r * (slab_layers() / ranks) + (r < slab_layers() % ranks ? r : slab_layers() % ranks);
  }
  [[nodiscard]] int first_layer() const { return first_layer_of(rank); }
  [[nodiscard]] int past_layer() const { return first_layer_of(rank + 1); }
  [[nodiscard]] bool shared() const { return ranks > 1; }
  /// Whether the node is this process's, and whose it is.
  [[nodiscard]] bool owns(int y, int z = 0) const {
    if (ranks == 1) return true;
    const int layer = slab_layer(y, z);
    return layer >= first_layer() && layer < past_layer();
  }
  [[nodiscard]] int owner(int y, int z = 0) const {
    const int whole = slab_layers() / ranks;
    const int more = slab_layers() % ranks;
    const int layer = slab_layer(y, z);
    return layer < more * (whole + 1) ? layer / (whole + 1) : more + (layer - more * (whole + 1)) / whole;
  }
  /// This process's rows: begin <= row < end.
  [[nodiscard]] int first_row() const { return nz > 0 ? first_layer() * ny : first_layer(); }
  [[nodiscard]] int past_row() const { return nz > 0 ? past_layer() * ny : past_layer(); }
  [[nodiscard]] bool periodic_slabs() const { return nz > 0 ? periodic_z : periodic_y; }

  /// Number of a node, x fastest.
  [[nodiscard]] std::size_t index(int x, int y, int z = 0) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(ny) + static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(nx) +
           static_cast<std::size_t>(x);
  }

  [[nodiscard]] double x(double i) const { return x0 + i * spacing; }
  [[nodiscard]] double y(double j) const { return y0 + j * spacing; }
  [[nodiscard]] double z(double k) const { return z0 + k * spacing; }
  [[nodiscard]] double to_lattice_x(double position) const { return (position - x0) / spacing; }
  [[nodiscard]] double to_lattice_y(double position) const { return (position - y0) / spacing; }
  [[nodiscard]] double to_lattice_z(double position) const { return (position - z0) / spacing; }

  /// Number of the column (row) that `i` means: the periodic image inside the grid, or `i` itself.
  [[nodiscard]] int wrap_x(int i) const { return periodic_x ? (i < 0 ? i + nx : (i >= nx ? i - nx : i)) : i; }
  [[nodiscard]] int wrap_y(int j) const { return periodic_y ? (j < 0 ? j + ny : (j >= ny ? j - ny : j)) : j; }
  [[nodiscard]] int wrap_z(int k) const { return periodic_z ? (k < 0 ? k + nz : (k >= nz ? k - nz : k)) : k; }
  [[nodiscard]] bool inside(int i, int j, int k = 0) const {
    return i >= 0 && i < nx && j >= 0 && j < ny && k >= 0 && k < layers();
  }
};

/// The image of `at` among `count` nodes of an axis, however far away it is; -1 where there is none.
inline int image_inside(int at, int count, bool periodic) {
  if (!periodic) return at >= 0 && at < count ? at : -1;
  const int wrapped = at % count;
  return wrapped < 0 ? wrapped + count : wrapped;
}

}  // namespace estuary::fluid
