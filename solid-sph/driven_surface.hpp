// The wet surface of another participant, as the bodies here meet it: a contour that moves as it is told,
// yields to nothing and takes up impulses.
//
// Inside a window a node moves on the cubic through displacement and velocity at both its ends (Hermite). The
// answer is the mean force on every node over the window: contacts are shorter than windows.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "estuary/v1/payload.pb.h"
#include "particles.hpp"

namespace estuary::solid {

/// Motion of contour particles, in the order of the body's, through a window.
struct SurfaceMotion {
  std::uint32_t first = 0;                                       // particle
  std::vector<double> start, start_velocity, end, end_velocity;  // displacements [m] and [m/s], 2 per node
  double time = 0, duration = 0;                                 // of the window [s]
  std::vector<std::array<std::uint32_t, 2>> torn = {};  // pieces of it, particles in the contour's order

  [[nodiscard]] std::size_t nodes() const { return start.size() / 2; }
  /// Displacement of component `c` (2 per node) at a time [m]; beyond the end at the velocity it has there.
  [[nodiscard]] double at(std::size_t c, double now) const;
};

class DrivenSurface {
public:
  /// Appends the surface to `body` as its last member, one particle without mass at each node. Throws
  /// std::invalid_argument when the surface is no set of lines in two dimensions.
  DrivenSurface(const v1::WetSurface& surface, Body& body);

  [[nodiscard]] const v1::WetSurface& surface() const { return surface_; }
  /// Puts the nodes of a state where `motion` has them. Throws std::invalid_argument for a field that is not
  /// of this surface.
  void place(const v1::Displacements& motion, State& state) const;
  /// From a state, at the start of a window, to `motion` at its end.
  [[nodiscard]] SurfaceMotion window(const State& start, const v1::Displacements& motion, double time,
                                     double duration) const;
  /// Nodal forces of the impulses of a window [N/m], their sum and moment about the origin at `end`.
  struct Load {
    v1::NodalForces forces;
    std::array<double, 2> sum{};
    double moment = 0;
  };
  [[nodiscard]] Load load(std::span<const double> impulse, double duration, const State& end) const;

private:
  v1::WetSurface surface_;
  std::uint32_t first_ = 0;
};

}  // namespace estuary::solid
