// What a box cuts out of the medium: solid volume and the mean stress of the contacts inside it.
#pragma once

#include "dynamics.hpp"

namespace estuary::grains {

template <int D>
struct RegionMeasure {
  double volume = 0;   // of the box
  double solid = 0;    // of the grains in it
  double surface = 0;  // of the grains in it [m2; m in the plane]
  /// Stress, compression positive: sum over contacts of force (of i on j) times branch (from i to j), each
  /// with the part of the branch inside the box (1.20 of the thesis; Christoffersen, Mehrabadi & Nemat-Nasser
  /// 1981).
  std::array<std::array<double, static_cast<std::size_t>(D)>, static_cast<std::size_t>(D)> stress{};
  double temperature = 0;   // m <(v - mean)^2> / D over grains with their centre inside [J]
  Vector<D> velocity{};     // mean, by mass
  double grains = 0;        // centres inside
  Vector<D> outer_force{};  // of what is given per grain, cut grains by their share inside, per volume [N/m3]
};

/// `outer_force`: D per grain in the scene's order, or empty.
template <int D>
RegionMeasure<D> measure_region(const Dynamics<D>& dynamics, const Vector<D>& from, const Vector<D>& to,
                                double radius_margin, std::span<const double> outer_force = {});

/// Share of a disc or sphere of radius r around 0 that lies below the plane at height h.
double share_below(int dimension, double r, double h);
/// Share of its outline (surface) that does; of a sphere's the height's own (Archimedes).
double surface_share_below(int dimension, double r, double h);

}  // namespace estuary::grains
