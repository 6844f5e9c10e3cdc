// The set of discrete velocities. Kernels are templates over such a descriptor and use nothing else of a
// lattice.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

namespace estuary::fluid {

/// Nine velocities in the plane: 0 at rest, 1 to 4 along the axes (E, N, W, S), 5 to 8 diagonal (NE, NW, SW,
/// SE). Source: Qian, d'Humieres, Lallemand, Europhys. Lett. 17 (1992).
struct D2Q9 {
  static constexpr int dimension = 2;
  static constexpr int count = 9;
  static constexpr std::array<std::array<int, 3>, 9> velocity{{{0, 0, 0},
                                                               {1, 0, 0},
                                                               {0, 1, 0},
                                                               {-1, 0, 0},
                                                               {0, -1, 0},
                                                               {1, 1, 0},
                                                               {-1, 1, 0},
                                                               {-1, -1, 0},
                                                               {1, -1, 0}}};
  static constexpr std::array<double, 9> weight{4.0 / 9.0,  1.0 / 9.0,  1.0 / 9.0,  1.0 / 9.0, 1.0 / 9.0,
                                                1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0};
  static constexpr std::array<int, 9> opposite{0, 3, 4, 1, 2, 7, 8, 5, 6};
  /// One direction of each pair of opposite directions.
  static constexpr std::array<int, 4> half{1, 2, 5, 6};
  /// Square of the speed of sound in lattice units.
  static constexpr double sound_speed_squared = 1.0 / 3.0;
  static constexpr const char* name = "d2q9";
};

/// Nineteen velocities in space: 0 at rest, 1 to 6 along the axes, 7 to 18 along the diagonals of the planes
/// xy, xz, yz. Source: the same.
struct D3Q19 {
  static constexpr int dimension = 3;
  static constexpr int count = 19;
  static constexpr std::array<std::array<int, 3>, 19> velocity{{{0, 0, 0},
                                                                {1, 0, 0},
                                                                {0, 1, 0},
                                                                {-1, 0, 0},
                                                                {0, -1, 0},
                                                                {0, 0, 1},
                                                                {0, 0, -1},
                                                                {1, 1, 0},
                                                                {-1, 1, 0},
                                                                {-1, -1, 0},
                                                                {1, -1, 0},
                                                                {1, 0, 1},
                                                                {-1, 0, 1},
                                                                {-1, 0, -1},
                                                                {1, 0, -1},
                                                                {0, 1, 1},
                                                                {0, -1, 1},
                                                                {0, -1, -1},
                                                                {0, 1, -1}}};
  static constexpr std::array<double, 19> weight{1.0 / 3.0,  1.0 / 18.0, 1.0 / 18.0, 1.0 / 18.0, 1.0 / 18.0,
                                                 1.0 / 18.0, 1.0 / 18.0, 1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0,
                                                 1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0,
                                                 1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0};
  static constexpr std::array<int, 19> opposite{0, 3,  4,  1,  2,  6,  5,  9,  10, 7,
                                                8, 13, 14, 11, 12, 17, 18, 15, 16};
  static constexpr std::array<int, 9> half{1, 2, 5, 7, 8, 11, 12, 15, 16};
  static constexpr double sound_speed_squared = 1.0 / 3.0;
  static constexpr const char* name = "d3q19";
};

/// The largest number of velocities, for arrays that serve every lattice.
inline constexpr int most_velocities = D3Q19::count;

/// The same numbers for code outside of the kernels, which learns the lattice when it runs.
struct LatticeTable {
  int dimension = 2;
  int count = 0;
  const std::array<int, 3>* velocity = nullptr;
  const double* weight = nullptr;
  const int* opposite = nullptr;
};

template <class Lattice>
[[nodiscard]] constexpr LatticeTable table_of() {
  return {Lattice::dimension, Lattice::count, Lattice::velocity.data(), Lattice::weight.data(),
          Lattice::opposite.data()};
}

[[nodiscard]] constexpr LatticeTable lattice_of_dimension(int dimension) {
  return dimension == 3 ? table_of<D3Q19>() : table_of<D2Q9>();
}

/// Calls `body` with each index as a compile-time constant, so that arrays it indexes can live in registers.
template <int count, class Body>
[[gnu::always_inline]] inline constexpr void unrolled(Body&& body) {
  [&]<int... index>(std::integer_sequence<int, index...>) __attribute__((always_inline)) {
    (body(std::integral_constant<int, index>{}), ...);
  }
  (std::make_integer_sequence<int, count>{});
}

}  // namespace estuary::fluid
