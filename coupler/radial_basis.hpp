// Interpolation by radial basis functions with a linear polynomial, as weights of the source's nodes.
#pragma once

#include <vector>

#include "mapping.hpp"

namespace estuary::coupler {

/// Most source nodes of the dense matrix, and most weights kept.
inline constexpr std::size_t most_radial_nodes = 4000;
inline constexpr std::size_t most_radial_weights = 30'000'000;

/// One row for each target node: with the basis phi and the polynomials p of the source's nodes,
///   row = [phi(target) p(target)] [Phi P; P^T 0]^-1, without the polynomial's part.
/// The polynomial spans the constant and the directions in which the source has an extent, so that flat
/// surfaces are no exception. Nodes at the same place count as one with the mean of their values.
std::vector<std::vector<Mapping::Entry>> radial_basis_rows(const MappingSettings& settings,
                                                           const v1::WetSurface& source,
                                                           const v1::WetSurface& target);

}  // namespace estuary::coupler
