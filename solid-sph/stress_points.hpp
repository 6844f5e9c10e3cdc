// Stress points: places between the particles where the stress is computed, while displacements and
// velocities live at the particles (Dyka & Ingel 1995; Randles & Libersky 2000; Vignjevic, Campbell &
// Libersky 2000).
//
// In the total Lagrangian form, with g_pj the gradient weights of particle j at stress point p,
//     F_p = sum_j x_j (x) g_pj,   f_j = - sum_p V_p P_p g_pj,
// minus the derivative of sum_p V_p W(F_p): momentum and angular momentum are conserved to round-off. The
// alternating mode that gives no gradient at the particles does give one between them. With one stress point
// in every cell of four particles one such mode is left (that of a quadrilateral with one integration point);
// two on a diagonal see it.
//
// In memory they follow the particles, as members of their body without mass that nothing moves: their
// weights add up to zero, so that their own displacement does not count.
#pragma once

#include <span>

#include "particles.hpp"

namespace estuary::solid {

/// Adds stress points to every body that is not rigid; they then carry its energy. Entry k of `boxes` is the
/// box of member k, with particles on its contour and no extra rows: `per_cell` (1 or 2) in each cell of four
/// particles. A null pointer stands for any other outline: one in each of Delaunay's triangles between the
/// particles. Throws std::invalid_argument when those do not fill the outline.
void add_stress_points(Body& body, std::span<const Box* const> boxes, int per_cell);

}  // namespace estuary::solid
