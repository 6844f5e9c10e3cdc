// The wet surface of shells: both faces, half a thickness from the mid-line along the fibres, with the blunt
// ends between them.
//
// A node moves as the fibre carries it, x = x_mid + a n(theta) with a = +-h/2; a force F on it acts as F on
// the particle and as the moment a n x F on its rotation. Force, moment in the current configuration and work
// are then the same on both sides.
#pragma once

#include "shell_row.hpp"
#include "surface_transfer.hpp"

namespace estuary::solid {

struct ShellFaces {
  std::vector<ContourLine> lines;
  Transfer mid_line;  // weights of particles for the nodes of all lines: of the particle each belongs to
  Transfer arm;       // the same entries times the signed distance of the node along the fibre [m]
};

/// Of every shell in `rows`, without the ends whose particles are held in both components: there the lines
/// are open.
ShellFaces shell_faces(const Body& body, const ShellRow& rows);

}  // namespace estuary::solid
