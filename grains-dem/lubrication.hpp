// Lubrication correction: the resistance of the thin film between two grains, or a grain and a plane wall,
// that a fluid grid can no longer resolve, added below a gap h_c and vanishing there.
//
//   discs    F = 3 sqrt(2) pi mu v (R*)^(3/2) (h^(-3/2) - h_c^(-3/2))   Reynolds' equation between two
//                                                                       cylinders
//   spheres  F = 6 pi mu v R*^2 (1/h - 1/h_c)                           Kim & Karrila 1991; Nguyen & Ladd
//   2002
//
// with v the speed of approach and R* = R_i R_j / (R_i + R_j), which at a plane is the grain's radius; h is
// not let below h_min (roughness).
#pragma once

#include <algorithm>

#include "contact_forces.hpp"

namespace estuary::grains {

struct Lubrication {
  double viscosity = 0;    // dynamic [Pa s]; 0: off
  double cutoff = 0;       // h_c between true surfaces [m]
  double minimum_gap = 0;  // h_min [m]
  /// How much the radius of contact exceeds the true one [m].
  double margin = 0;
  [[nodiscard]] bool active() const { return viscosity > 0; }
  /// How far it reaches beyond the radii of contact: of two grains, of a grain at a plane [m].
  [[nodiscard]] double range_of_pair() const { return std::max(0.0, cutoff - 2 * margin); }
  [[nodiscard]] double range_at_plane() const { return std::max(0.0, cutoff - margin); }
};

/// Force over speed of approach of a film of thickness `gap` [N s/m; per metre of depth in the plane].
template <int D>
double film_resistance(const Lubrication& lubrication, double reduced_radius, double gap);

/// Adds the forces of the pairs in rows of one block after sweep_pairs; what they dissipate goes to
/// ledger.normal.
template <int D>
void sweep_lubrication(const Lubrication& lubrication, const SweepInput<D>& input, std::size_t block,
                       State<D>& state, CrossForces<D>& cross, EnergyLedger& ledger);

/// Force on grain `i` of the film between it and a plane.
template <int D>
Vector<D> plane_film_force(const Lubrication& lubrication, const Wall<D>& wall, const State<D>& state,
                           std::size_t i);

/// Adds the forces of plane walls on the grains of one block after sweep_walls, and what the grains give the
/// walls to `wall_force`. Polylines and meshes have no film.
template <int D>
void sweep_plane_lubrication(const Lubrication& lubrication, double dt, double lag,
                             const std::vector<Wall<D>>& walls, std::size_t block,
                             const std::vector<std::uint32_t>& first_contact, State<D>& state,
                             std::vector<Vector<D>>& wall_force, EnergyLedger& ledger);

}  // namespace estuary::grains
