// Fields between the nodes.
#pragma once

#include <array>

#include "cells.hpp"
#include "fields.hpp"
#include "sides.hpp"

namespace estuary::fluid {

struct Sample {
  std::array<double, 3> velocity{};  // lattice units
  double excess = 0;
};

/// At a point in lattice coordinates. Among fluid nodes by polynomials of degree three along each axis,
/// one-sided beside the grid's outermost nodes; where one of these nodes is no fluid, linear between the
/// nodes next to the point, those that are no fluid leaving their weight to the others, and zero inside the
/// solid. Between the outermost node and a wall of the grid, half a spacing away, velocities go linearly to
/// the wall's.
[[nodiscard]] Sample sample_at(const Fields& fields, const Cells& cells, const Sides& sides,
                               const std::array<double, 3>& at);

}  // namespace estuary::fluid
