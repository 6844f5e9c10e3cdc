// Lubrication correction: the resistance of the thin film between two grains that a fluid grid can no longer
// resolve, added below a gap h_c and vanishing there.
//
//   discs    F = 3 sqrt(2) pi mu v (R*)^(3/2) (h^(-3/2) - h_c^(-3/2))   Reynolds' equation between two
//   cylinders spheres  F = 6 pi mu v R*^2 (1/h - 1/h_c)                           Kim & Karrila 1991; Nguyen
//   & Ladd 2002
//
// with v the speed of approach; h is not let below h_min (roughness).
#pragma once

#include "contact_forces.hpp"

namespace estuary::grains {

struct Lubrication {
  double viscosity = 0;    // dynamic [Pa s]; 0: off
  double cutoff = 0;       // h_c between true surfaces [m]
  double minimum_gap = 0;  // h_min [m]
  /// How much the radius of contact exceeds the true one [m].
  double margin = 0;
  [[nodiscard]] bool active() const { return viscosity > 0; }
};

/// Adds the forces of the pairs in rows of one block after sweep_pairs; what they dissipate goes to
/// ledger.normal.
template <int D>
void sweep_lubrication(const Lubrication& lubrication, const SweepInput<D>& input, std::size_t block,
                       State<D>& state, CrossForces<D>& cross, EnergyLedger& ledger);

}  // namespace estuary::grains
