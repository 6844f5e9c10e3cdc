// Carries fields between two wet surfaces that do not share their nodes.
//
// A mapping is a matrix H from the nodes of one surface (the source) to those of another (the target):
//   consistent    u_target = H u_source        displacements, velocities, pressures: constants stay constants
//   conservative  f_source = H^T f_target      forces: the same sum and, because the transpose is used with
//                                              the same H, the same power f . v on both sides, to round-off.
// Moments are kept as well when H is exact for linear fields and therefore for the positions themselves.
//
//   nearest_neighbour   value of the nearest node; exact for constants, first order
//   nearest_projection  linear on the facet nearest to the target node; exact for linear fields where the
//                       target lies on the source's facets, second order
//   thin_plate_spline   radial basis function r^2 log r with a linear polynomial; exact for linear fields
//   wendland_c2, _c4    compactly supported functions of the given radius with a linear polynomial (Wendland
//                       1995); exact for linear fields, smoother the larger the radius
// de Boer, van Zuijlen & Bijl (2007), Comput. Methods Appl. Mech. Engrg. 196, 1515-1525, compares them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "estuary/v1/payload.pb.h"

namespace estuary::coupler {

enum class MappingKind { nearest_projection, nearest_neighbour, thin_plate_spline, wendland_c2, wendland_c4 };

struct MappingSettings {
  MappingKind kind = MappingKind::nearest_projection;
  double support_radius = 0;  // of the Wendland functions [m]
};

/// The matrix H, row by row.
class Mapping {
public:
  struct Entry {
    std::uint32_t source;
    double weight;
  };
  /// `rows[k]`: the sources of target node k with their weights.
  Mapping(std::size_t sources, const std::vector<std::vector<Entry>>& rows);

  [[nodiscard]] std::size_t sources() const { return sources_; }
  [[nodiscard]] std::size_t targets() const { return row_begin_.size() - 1; }
  /// H values, with `components` numbers for each node. Throws std::invalid_argument for another number of
  /// values than the source has.
  [[nodiscard]] std::vector<double> consistent(std::span<const double> values, std::size_t components) const;
  /// H^T loads; `loads` lives on the target, the result on the source.
  [[nodiscard]] std::vector<double> conservative(std::span<const double> loads, std::size_t components) const;

private:
  std::size_t sources_;
  std::vector<std::size_t> row_begin_;
  std::vector<Entry> entries_;
};

/// What a mapping does to fields that should pass unchanged.
struct MappingQuality {
  double largest_distance = 0;  // from a target node to where the mapping puts it [m]
  double constant_defect = 0;   // largest |H 1 - 1|
};
MappingQuality quality_of(const Mapping& mapping, const v1::WetSurface& source, const v1::WetSurface& target);

/// Nodes may come in any order, unevenly spaced and more than once. Throws std::invalid_argument, saying what
/// to do, when the surfaces differ in dimension, a support radius reaches no node, the radial basis functions
/// are too many for their dense matrix or so alike that it cannot be solved.
Mapping make_mapping(const MappingSettings& settings, const v1::WetSurface& source,
                     const v1::WetSurface& target);

}  // namespace estuary::coupler
