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
  static constexpr std::array<std::array<int, 2>, 9> velocity{
      {{0, 0}, {1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};
  static constexpr std::array<double, 9> weight{4.0 / 9.0,  1.0 / 9.0,  1.0 / 9.0,  1.0 / 9.0, 1.0 / 9.0,
                                                1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0, 1.0 / 36.0};
  static constexpr std::array<int, 9> opposite{0, 3, 4, 1, 2, 7, 8, 5, 6};
  /// One direction of each pair of opposite directions.
  static constexpr std::array<int, 4> half{1, 2, 5, 6};
  /// Square of the speed of sound in lattice units.
  static constexpr double sound_speed_squared = 1.0 / 3.0;
  static constexpr const char* name = "d2q9";
};

/// Calls `body` with each index as a compile-time constant, so that arrays it indexes can live in registers.
template <int count, class Body>
[[gnu::always_inline]] inline constexpr void unrolled(Body&& body) {
  [&]<int... index>(std::integer_sequence<int, index...>) __attribute__((always_inline)) {
    (body(std::integral_constant<int, index>{}), ...);
  }
  (std::make_integer_sequence<int, count>{});
}

}  // namespace estuary::fluid
